"""Velocities and biases to start from: those that fit the IMU to a path which may still move a little."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.config import ImuConfig
from vgps.imu.camera_imu import CameraImu
from vgps.imu.factors import imu_graph
from vgps.imu.states import ImuStates, as_bias, bias_key, first_states, velocity_key
from vgps.model import BoolArray
from vgps.solution import Trajectory

_ROTATION_SIGMA, _POSITION_SIGMA_M = np.radians(2.0), 0.2  # of a path before stage D
_ROUNDS = 2  # the second integrates with the biases of the first


def start_states(path: Trajectory, loose: BoolArray, imu: CameraImu, config: ImuConfig) -> ImuStates | None:
    """Return velocities and biases at knots of a path; arguments and None as for :func:`first_states`."""
    states = first_states(path, loose, imu, config)
    for _ in range(_ROUNDS if states is not None else 0):
        assert states is not None
        states = _fitted(states, path, imu, config)
    return states


def _fitted(states: ImuStates, path: Trajectory, imu: CameraImu, config: ImuConfig) -> ImuStates:
    graph, values = imu_graph(imu, states, path.t_s, config), gtsam.Values()
    loose = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([_ROTATION_SIGMA, _POSITION_SIGMA_M], 3))
    for k, frame in enumerate(states.frame.tolist()):
        pose = gtsam.Pose3(path.world_T_camera[frame])
        graph.addPriorPose3(X(frame), pose, loose)
        values.insert(X(frame), pose)
        values.insert(velocity_key(k), states.velocity[k])
        values.insert(bias_key(k), as_bias(states.bias[k]))
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    knots = range(len(states))
    vectors = {velocity_key(k): result.atVector(velocity_key(k)) for k in knots}
    vectors |= {bias_key(k): result.atConstantBias(bias_key(k)).vector() for k in knots}
    return states.moved(vectors)

"""Velocities and biases of an IMU as states of the problem of stage D."""

from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.imu.start import start_states
from vgps.imu.states import ImuStates, bias_key, velocity_key
from vgps.model import BoolArray, FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.scene import Scene
from vgps.solver.marginals import Covariances
from vgps.solver.problem import BundleProblem
from vgps.solver.state_vectors import StateVector


def start_imu(scene: Scene, context: SmoothingContext) -> ImuStates | None:
    """Return velocities and biases that fit a scene; None without an IMU, or where it has no samples."""
    if context.imu is None:
        return None
    loose = weakly_held_frames(scene, context.config.tracking.min_inliers)
    return start_states(scene.trajectory, loose, context.imu, context.config.imu)


def weakly_held_frames(scene: Scene, fewest: int) -> BoolArray:
    """Return the frames (F,) that the IMU has to hold.

    These are frames with fewer than ``fewest`` observations that do not stand still, with their neighbours,
    and the frames on either side of a place that fewer tracks cross, as between maps.
    """
    few, torn = scene.hardly_seen(fewest), scene.torn(fewest)
    loose = few.copy()
    loose[1:] |= few[:-1] | torn
    loose[:-1] |= few[1:] | torn
    return np.asarray(loose)


def imu_state_vectors(imu: ImuStates) -> dict[int, StateVector]:
    """Return velocities and biases as states of a problem, by their keys."""
    states = {}
    for k, frame in enumerate(imu.frame.tolist()):
        states[velocity_key(k)] = StateVector(imu.velocity[k], frame)
        states[bias_key(k)] = StateVector(imu.bias[k], frame, is_bias=True)
    return states


def imu_links(graph: gtsam.NonlinearFactorGraph) -> gtsam.NonlinearFactorGraph:
    """Return the factors of preintegrated rates and forces among those of a graph."""
    links = gtsam.NonlinearFactorGraph()
    for k in range(graph.size()):
        if isinstance(graph.at(k), gtsam.ImuFactor):
            links.push_back(graph.at(k))
    return links


@dataclass(frozen=True)
class ImuBias:
    """Bias (6,) of specific force [m/s^2] and rates [rad/s] with its covariance (6, 6), in the camera's axes.

    The covariance is NaN if the system does not determine it.
    """

    bias: FloatArray
    covariance: FloatArray

    def report(self, imu_R_camera: FloatArray) -> dict[str, list[float]]:
        """Return both biases in the IMU's axes, and their standard deviations where they are known."""
        turn = np.kron(np.eye(2), imu_R_camera)
        force, rates = np.split(turn @ self.bias, 2)
        report = {"accelerometer_m_s2": force.tolist(), "gyro_rad_s": rates.tolist()}
        force, rates = np.split(np.sqrt(np.diag(turn @ self.covariance @ turn.T)), 2)
        if np.isfinite(self.covariance).all():
            report |= {"accelerometer_sigma_m_s2": force.tolist(), "gyro_sigma_rad_s": rates.tolist()}
        return report


def middle_bias(imu: ImuStates, end: BundleProblem, covariances: Covariances) -> ImuBias:
    """Return the bias at the knot in the middle of a recording.

    Args:
        imu: Knots.
        end: The problem at its minimum.
        covariances: Of its states.
    """
    key = bias_key(len(imu) // 2)
    return ImuBias(end.states[key].vector, covariances.states.get(key, np.full((6, 6), np.nan)))

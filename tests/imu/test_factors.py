from pathlib import Path

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from inertial import GRAVITY_M_S2, MOUNT, exact_log, path_of, swinging_motion

from vgps.config import ImuConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.factors import imu_graph, preintegrate
from vgps.imu.states import as_bias, bias_key, first_states, velocity_key
from vgps.model import ImuLog, ImuMount
from vgps.solution import Trajectory

MOTION, CONFIG = swinging_motion(), ImuConfig()
PATH = path_of(MOTION)
IMU = imu_at_camera(exact_log(MOTION), MOUNT, None, CONFIG)
STATES = first_states(PATH, np.zeros(len(PATH.t_s), dtype=bool), IMU, CONFIG)


def exact_values():
    values = gtsam.Values()
    for k, frame in enumerate(STATES.frame.tolist()):
        values.insert(X(frame), gtsam.Pose3(PATH.world_T_camera[frame]))
        values.insert(velocity_key(k), MOTION.spline(PATH.t_s[frame], 1)[:3])
        values.insert(bias_key(k), as_bias(np.zeros(6)))
    return values


def test_the_exact_motion_costs_nothing():
    graph = imu_graph(IMU, STATES, PATH.t_s, CONFIG)
    links = len(STATES) - 1
    assert graph.size() == 2 * links + 1
    assert graph.error(exact_values()) < 0.2 * links  # 4.5 a link would be noise of the expected size


def test_a_second_of_motion_is_predicted():
    """Without gravity the path would end g / 2 higher after a second."""
    measured = preintegrate(IMU, 2.0, 3.0, np.zeros(6), CONFIG)
    start = gtsam.NavState(gtsam.Pose3(PATH.world_T_camera[20]), MOTION.spline(2.0, 1)[:3])
    end = measured.predict(start, as_bias(np.zeros(6)))
    np.testing.assert_allclose(end.position(), PATH.world_T_camera[30, :3, 3], atol=2e-3)
    np.testing.assert_allclose(end.pose().rotation().matrix(), PATH.world_T_camera[30, :3, :3], atol=1e-4)
    without_gravity = PATH.world_T_camera[20, :3, :3] @ measured.deltaPij() + MOTION.spline(2.0, 1)[:3]
    moved = PATH.world_T_camera[30, :3, 3] - PATH.world_T_camera[20, :3, 3]
    np.testing.assert_allclose(without_gravity - moved, [0.0, 0.0, GRAVITY_M_S2 / 2.0], atol=2e-3)


def test_errors_grow_with_noise_and_with_rotation():
    quiet, moving = (
        preintegrate(IMU, 2.0, 3.0, np.zeros(6), ImuConfig(scale_error=share)).preintMeasCov()
        for share in (1e-9, 0.02)
    )
    assert np.sqrt(quiet[0, 0]) == pytest.approx(IMU.gyro_density, rel=0.01)
    rotation = gtsam.Rot3.Logmap(preintegrate(IMU, 2.0, 3.0, np.zeros(6), CONFIG).deltaRij())
    expected = np.hypot(IMU.gyro_density, 0.02 * np.linalg.norm(rotation))
    assert np.sqrt(moving[0, 0]) == pytest.approx(expected, rel=0.03)


def test_a_blow_to_the_sensor_pulls_less_than_its_square():
    graph, values = imu_graph(IMU, STATES, PATH.t_s, CONFIG), exact_values()
    errors = []
    for blow in (20.0, 40.0):
        struck = gtsam.Values(values)
        struck.update(velocity_key(3), values.atVector(velocity_key(3)) + blow)
        errors.append(graph.error(struck))
    assert 1.8 < errors[1] / errors[0] < 2.2  # Huber: linear, not four times


def test_the_gyros_bias_is_known_as_a_walk_seen_through_white_noise():
    """With rotations known, its information is that of its walk and of the mean rate of each second."""
    knots, noise = 11, ImuConfig(scale_error=1e-9)
    t_s = np.arange(-0.5, 10.5, 0.005)
    resting = ImuLog(
        t_s=t_s,
        rate_rad_s=np.zeros((len(t_s), 3)),
        force_m_s2=np.tile([0.0, 0.0, GRAVITY_M_S2], (len(t_s), 1)),
        saturated=np.zeros(len(t_s), dtype=bool),
        source=Path("imu.csv"),
    )
    imu = imu_at_camera(resting, ImuMount(imu_R_camera=np.eye(3)), None, noise)
    path = Trajectory(np.arange(float(knots)), np.tile(np.eye(4), (knots, 1, 1)))
    states = first_states(path, np.ones(knots, dtype=bool), imu, noise)
    graph, values = imu_graph(imu, states, path.t_s, noise), gtsam.Values()
    known = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([3e-6, 1.0], 3))
    for k in range(knots):
        graph.addPriorPose3(X(k), gtsam.Pose3(), known)
        values.insert(X(k), gtsam.Pose3())
        values.insert(velocity_key(k), np.zeros(3))
        values.insert(bias_key(k), as_bias(np.zeros(6)))
    found = gtsam.Marginals(graph, values).marginalCovariance(bias_key(5))[3:, 3:]

    information = np.diag([noise.gyro_bias_sigma**-2] + [0.0] * (knots - 1))
    for k in range(knots - 1):
        information[k, k] += imu.gyro_density**-2
        information[k : k + 2, k : k + 2] += noise.gyro_bias_walk**-2 * np.array([[1, -1], [-1, 1]])
    np.testing.assert_allclose(found, np.linalg.inv(information)[5, 5] * np.eye(3), rtol=0.01, atol=1e-12)

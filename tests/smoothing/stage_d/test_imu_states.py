"""Where the IMU holds a path, and what a run reports of its biases."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from inertial import MOUNT, exact_log
from scipy.interpolate import CubicSpline
from synthetic_bundle import ANTENNA
from synthetic_map import CAMERA

from vgps.config import Config, ImuConfig, StartConfig
from vgps.gps.sensors import Sensors
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.factors import imu_graph
from vgps.imu.start import start_states
from vgps.imu.states import as_bias, bias_key, velocity_key
from vgps.mapping.zero_motion import ZeroMotion
from vgps.simulate import Motion
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.factor_graph import joined, other_pose_factors
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.imu_states import ImuBias, start_imu, weakly_held_frames
from vgps.solution import Observations, Trajectory


def test_biases_are_reported_in_the_axes_of_the_imu():
    covariance = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) ** 2
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert ImuBias(np.arange(6.0), covariance).report(quarter) == {
        "accelerometer_m_s2": [-1.0, 0.0, 2.0],
        "gyro_rad_s": [-4.0, 3.0, 5.0],
        "accelerometer_sigma_m_s2": [2.0, 1.0, 3.0],
        "gyro_sigma_rad_s": [5.0, 4.0, 6.0],
    }
    unknown = ImuBias(np.arange(6.0), np.full((6, 6), np.nan)).report(quarter)
    assert unknown.keys() == {"accelerometer_m_s2", "gyro_rad_s"}


def tracks(*spans):
    """Observations of features, each in all frames from one to another."""
    frame = np.concatenate([np.arange(first, last + 1) for first, last in spans])
    landmark = np.repeat(np.arange(len(spans)), [last + 1 - first for first, last in spans])
    return Observations(frame, landmark, np.zeros((len(frame), 2)))


def test_the_imu_holds_frames_that_few_features_show_and_both_sides_of_a_seam_between_maps():
    poses, standing = np.tile(np.eye(4), (12, 1, 1)), ZeroMotion(9, 8, np.eye(4), np.ones(6))
    spans = [(0, 2), (0, 2), (4, 6), (4, 6), (7, 8), (7, 8), (7, 11), (10, 11), (0, 3)]
    scene = Scene(np.arange(12.0), poses, np.zeros((len(spans), 3)), tracks(*spans), (standing,))
    # frame 3 shows one feature; no track leads from 6 to 7; one leads from the standing frame 9 to 10
    assert np.flatnonzero(weakly_held_frames(scene, 2)).tolist() == [2, 3, 4, 6, 7, 9, 10]
    assert np.flatnonzero(weakly_held_frames(scene, 1)).tolist() == [3, 4, 6, 7]
    looped = replace(scene, loop=np.where(scene.observations.landmark == 8, 0, -1))
    assert np.flatnonzero(weakly_held_frames(looped, 1)).tolist() == [2, 3, 4, 6, 7]


def test_the_imu_holds_a_frame_between_observations_of_tracks_and_its_neighbours():
    interrupted = Observations(np.array([0, 1, 2, 4, 5, 6]), np.zeros(6, dtype=int), np.zeros((6, 2)))
    scene = Scene(np.arange(7.0), np.tile(np.eye(4), (7, 1, 1)), np.zeros((1, 3)), interrupted)
    assert np.flatnonzero(weakly_held_frames(scene, 1)).tolist() == [2, 3, 4]


def two_maps(config):
    """A scene in which no track leads from frame 5 to frame 6, and velocities and biases of an IMU."""
    t_s, values = 0.25 * np.arange(11), np.zeros((5, 6))
    values[:, 0] = 3.0 * np.arange(-1.0, 4.0)
    motion = Motion(CubicSpline(np.arange(-1.0, 4.0), values))
    spans = [span for span in ((0, 5), (6, 10)) for _ in range(config.tracking.min_inliers)]
    scene = Scene(t_s, motion.poses(t_s), np.zeros((len(spans), 3)), tracks(*spans))
    imu = imu_at_camera(exact_log(motion, duration_s=2.5), MOUNT, None, config.imu)
    return scene, start_imu(scene, SmoothingContext(CAMERA, config, imu=imu))


def test_both_sides_of_a_seam_between_maps_are_knots():
    _, states = two_maps(Config())
    assert states.frame.tolist() == [0, 5, 6, 10]  # the others by their times


def test_constant_velocity_holds_frames_between_knots_that_lost_their_features():
    config = Config()
    scene, states = two_maps(config)
    seen, sensors = scene.observations, Sensors.fixed(ANTENNA)
    fewer = scene.with_observations((seen.frame != 8) | (seen.landmark == seen.landmark.max()))
    more, before = (other_pose_factors(one, sensors, config, states).size() for one in (fewer, scene))
    assert more > before


def test_what_is_level_is_shared_between_a_bias_and_a_tilt():
    """Where a camera only goes straight, a bias across its path and its roll look alike: priors decide."""
    t_s, bias, level_deg = np.arange(11.0), 0.2, 1.0
    values = np.zeros((14, 6))
    values[:, 0] = 3.0 * np.arange(-1.0, 13.0)
    motion = Motion(CubicSpline(np.arange(-1.0, 13.0), values))
    path = Trajectory(t_s, motion.poses(t_s))
    across = MOUNT.imu_R_camera @ [bias, 0.0, 0.0]
    config = Config(start=StartConfig(level_sigma_deg=level_deg), imu=ImuConfig(accelerometer_bias_walk=1e-6))
    imu = imu_at_camera(exact_log(motion, accelerometer_bias=across), MOUNT, None, config.imu)
    none = np.zeros(0, dtype=np.int64)
    nothing = Observations(none, none, np.zeros((0, 2)))
    scene = Scene(t_s, path.world_T_camera, np.zeros((0, 3)), nothing)
    states = start_states(path, np.zeros(11, dtype=bool), imu, config.imu)
    others = other_pose_factors(scene, Sensors.fixed(ANTENNA), config, states)
    graph, start = joined(others, imu_graph(imu, states, t_s, config.imu)), gtsam.Values()
    for k, pose in enumerate(map(gtsam.Pose3, path.world_T_camera)):
        graph.push_back(gtsam.GPSFactor(X(k), pose.translation(), gtsam.noiseModel.Isotropic.Sigma(3, 0.01)))
        start.insert(X(k), pose)
        start.insert(velocity_key(k), states.velocity[k])
        start.insert(bias_key(k), as_bias(states.bias[k]))
    found = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    roll = np.arcsin(found.atPose3(X(5)).rotation().matrix()[2, 0])
    level, drawn = np.radians(level_deg), config.imu.accelerometer_bias_sigma / imu.gravity_m_s2
    assert abs(roll) == pytest.approx(bias / imu.gravity_m_s2 / (1.0 + (drawn / level) ** 2), rel=0.1)

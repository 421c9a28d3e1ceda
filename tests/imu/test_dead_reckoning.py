import numpy as np
import pytest
from angles import apart_deg
from inertial import MOUNT, exact_log, path_of, swinging_motion

from vgps.config import ImuConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.dead_reckoning import DeadReckoning, PathErrors
from vgps.solution import Trajectory

END_S = 6.0
ERRORS = PathErrors(tilt_rad=np.radians(1.0), scale=0.03, scale_walk=0.01)
PATH = path_of(swinging_motion(), END_S)
BIASES = {"gyro_bias": np.array([0.01, -0.02, 0.01]), "accelerometer_bias": np.array([0.1, -0.05, 0.1])}


def reckoned(path, away_s, errors=ERRORS, **biases):
    """The pose some seconds after the end of a path."""
    imu = imu_at_camera(exact_log(swinging_motion(), **biases), MOUNT, None, ImuConfig())
    return DeadReckoning(imu, ImuConfig()).pose(path, errors, END_S + away_s)


def moved(poses, scale=1.0, step_m=0.0):
    """A path with another scale, and a step before its last five frames."""
    poses = poses.copy()
    poses[:, :3, 3] *= scale
    poses[-5:, :3, 3] += step_m
    return Trajectory(PATH.t_s, poses)


def true_pose(t_s):
    return swinging_motion().poses(np.array([t_s]))[0]


@pytest.mark.parametrize(("away_s", "tolerance_m"), [(0.1, 0.002), (1.0, 0.02), (3.0, 0.1)])
def test_an_exact_imu_with_biases_goes_on_along_the_true_path(away_s, tolerance_m):
    true, found = true_pose(END_S + away_s), reckoned(PATH, away_s, **BIASES)
    straight = (
        PATH.world_T_camera[-1, :3, 3] + 10.0 * away_s * np.diff(PATH.world_T_camera[-2:, :3, 3], axis=0)[0]
    )
    away_m = np.linalg.norm(found.world_T_camera[:3, 3] - true[:3, 3])
    assert away_m < tolerance_m < 0.25 * np.linalg.norm(straight - true[:3, 3])
    assert away_m < 3.0 * np.sqrt(np.trace(found.covariance_m2))
    assert apart_deg(found.world_T_camera, true) < 3.0 * np.degrees(found.sigma_rad)


def test_errors_grow_with_the_time_since_the_path_ended():
    sigmas = [np.sqrt(np.trace(reckoned(PATH, away_s).covariance_m2)) for away_s in (0.5, 1.0, 2.0)]
    assert sigmas[2] > 2.0 * sigmas[1] > 4.0 * sigmas[0]
    assert reckoned(PATH, 2.0).sigma_rad > reckoned(PATH, 1.0).sigma_rad


@pytest.mark.parametrize("name", PathErrors._fields)
def test_errors_of_the_path_are_errors_of_the_movement(name):
    variance = []
    for factor in (0.5, 1.0, 2.0):
        errors = ERRORS._replace(**{name: factor * getattr(ERRORS, name)})
        variance.append(np.trace(reckoned(PATH, 2.0, errors).covariance_m2))
    assert variance[2] > 1.01 * variance[1] > 1.01**2 * variance[0]


def test_noise_alone_adds_less_than_all_errors():
    imu = imu_at_camera(exact_log(swinging_motion()), MOUNT, None, ImuConfig())
    for away_s in (0.1, 1.0, 3.0):
        total_m = np.sqrt(np.trace(reckoned(PATH, away_s).covariance_m2))
        assert 0.0 < DeadReckoning(imu, ImuConfig()).least_sigma_m(away_s) < total_m


def test_the_movement_has_the_true_length_if_the_path_has_a_wrong_scale():
    path = moved(PATH.world_T_camera, scale=1.05)
    found = (
        reckoned(path, 2.0, ERRORS._replace(scale=0.1)).world_T_camera[:3, 3] - path.world_T_camera[-1, :3, 3]
    )
    true = true_pose(END_S + 2.0)[:3, 3] - true_pose(END_S)[:3, 3]
    assert np.linalg.norm(found - true) < 0.5 * 0.05 * np.linalg.norm(true)


def test_a_step_of_the_path_is_no_velocity():
    path = moved(PATH.world_T_camera, step_m=0.3)
    found = reckoned(path, 1.0).world_T_camera[:3, 3] - path.world_T_camera[-1, :3, 3]
    assert np.linalg.norm(found - true_pose(END_S + 1.0)[:3, 3] + true_pose(END_S)[:3, 3]) < 0.05


def test_there_is_no_pose_without_samples_or_a_path_that_shows_the_velocity():
    assert reckoned(PATH, 10.0) is None  # the log ends before
    assert reckoned(Trajectory(PATH.t_s[-6:], PATH.world_T_camera[-6:]), 1.0) is None

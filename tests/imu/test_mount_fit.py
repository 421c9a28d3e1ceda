from dataclasses import replace

import numpy as np
import pytest
from angles import apart_deg
from scipy.spatial.transform import Rotation
from synthetic_rotations import MOUNT, camera_rotations, gyro_log, rich

from vgps.geometry.angular_rates import GyroIntegral
from vgps.imu.mount_fit import Mount, fit_mount, residuals

ROBUST = 2.5
START = MOUNT.moved(np.array([0.1, -0.15, 0.1, 0.03, 0.0, 0.0, 0.0]))
START = replace(START, bias_rad_s=np.zeros(3))


def test_moved_turns_about_the_cameras_axes() -> None:
    quarter = MOUNT.moved(np.array([0, 0, np.pi / 2, 0.5, 0.1, 0.2, 0.3]))
    # what was the camera's x is now its y, as the gyro sees it
    np.testing.assert_allclose(quarter.gyro_R_camera[:, 0], MOUNT.gyro_R_camera[:, 1], atol=1e-12)
    assert quarter.time_offset_s == pytest.approx(0.637)
    np.testing.assert_allclose(quarter.bias_rad_s, MOUNT.bias_rad_s + np.array([0.1, 0.2, 0.3]))


def test_nothing_is_left_at_the_truth_and_only_there() -> None:
    turns, gyro = camera_rotations(rich, 10.0), GyroIntegral(gyro_log(rich, 10.0))
    assert np.abs(residuals(turns, gyro, MOUNT)).max() < 5e-6
    inverse = Mount(MOUNT.gyro_R_camera.T, MOUNT.time_offset_s, MOUNT.bias_rad_s)
    other_clock = Mount(MOUNT.gyro_R_camera, -MOUNT.time_offset_s, MOUNT.bias_rad_s)
    other_bias = Mount(MOUNT.gyro_R_camera, MOUNT.time_offset_s, -MOUNT.bias_rad_s)
    for wrong in (inverse, other_clock, other_bias):
        assert np.abs(residuals(turns, gyro, wrong)).max() > 1e-3


def test_a_residual_by_hand() -> None:
    """A gyro turned by a quarter about z; the camera turned by 0.1 rad about its x, the gyro says 0.12."""
    R = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    turns = camera_rotations(lambda t: np.tile([2.0, 0, 0], (len(t), 1)), 0.05)
    log = gyro_log(lambda t: np.tile([2.4, 0, 0], (len(t), 1)), 1.0, Mount(R, 0.0, np.zeros(3)))
    np.testing.assert_allclose(log.rate_rad_s[0], [0, 2.4, 0], atol=1e-12)
    found = residuals(turns, GyroIntegral(log), Mount(R, 0.0, np.zeros(3)))
    np.testing.assert_allclose(found, [[0.02, 0, 0]], atol=1e-12)


@pytest.mark.slow
def test_the_mount_is_found_exactly_without_noise() -> None:
    turns, gyro = camera_rotations(rich, 20.0), GyroIntegral(gyro_log(rich, 20.0))
    fit = fit_mount(turns, gyro, START, ROBUST)
    assert apart_deg(fit.mount.gyro_R_camera, MOUNT.gyro_R_camera) < 0.005
    assert fit.mount.time_offset_s == pytest.approx(MOUNT.time_offset_s, abs=1e-5)
    np.testing.assert_allclose(fit.mount.bias_rad_s, MOUNT.bias_rad_s, atol=2e-5)


@pytest.mark.slow
def test_wrong_rotations_hardly_count() -> None:
    rng = np.random.default_rng(1)
    turns = camera_rotations(rich, 20.0, 1e-3, rng)
    bad = rng.permutation(len(turns))[:40]
    wrong = turns.start_R_end.copy()
    wrong[bad] = Rotation.from_rotvec(rng.normal(0, 0.1, (40, 3))).as_matrix() @ wrong[bad]
    fit = fit_mount(replace(turns, start_R_end=wrong), GyroIntegral(gyro_log(rich, 20.0)), START, ROBUST)
    assert apart_deg(fit.mount.gyro_R_camera, MOUNT.gyro_R_camera) < 0.4  # four standard deviations
    assert np.median(fit.weight[bad]) < 0.05
    assert np.median(np.delete(fit.weight, bad)) > 0.5


@pytest.mark.slow
def test_the_covariance_is_that_of_many_runs() -> None:
    """Errors in units of their standard deviations: 10 runs of 7 parameters, a mean square of one."""
    squares = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        turns = camera_rotations(rich, 8.0, 2e-3, rng)
        fit = fit_mount(turns, GyroIntegral(gyro_log(rich, 8.0, noise_rad_s=1e-3, rng=rng)), MOUNT, ROBUST)
        turned = Rotation.from_matrix(MOUNT.gyro_R_camera.T @ fit.mount.gyro_R_camera).as_rotvec()
        clock = fit.mount.time_offset_s - MOUNT.time_offset_s
        error = np.concatenate([turned, [clock], fit.mount.bias_rad_s - MOUNT.bias_rad_s])
        squares.append(error**2 / np.diag(fit.covariance))
    # never optimistic: the larger of two estimates is given
    assert 0.4 < np.mean(squares) < 1.3

from dataclasses import replace

import numpy as np
import pytest
from inertial import GRAVITY_M_S2, MOUNT, exact_log, swinging_motion

from vgps.config import ImuConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.model import ImuMount

CONFIG = ImuConfig()


def test_the_lever_arm_and_the_mounting_are_removed():
    motion = swinging_motion()
    at_camera = imu_at_camera(exact_log(motion), MOUNT, None, CONFIG)
    unmoved = ImuMount(imu_R_camera=np.eye(3))
    expected = exact_log(motion, unmoved)
    np.testing.assert_allclose(at_camera.rate_rad_s, expected.rate_rad_s, atol=1e-9)
    # the angular acceleration is a difference over 10 ms
    np.testing.assert_allclose(at_camera.force_m_s2[2:-2], expected.force_m_s2[2:-2], atol=2e-3)
    arm = exact_log(motion).force_m_s2 @ MOUNT.imu_R_camera - expected.force_m_s2
    assert np.abs(arm).max() > 0.05


def test_gravity_of_no_place_is_standard():
    assert imu_at_camera(exact_log(swinging_motion()), MOUNT, None, CONFIG).gravity_m_s2 == GRAVITY_M_S2


def test_gaps_and_saturated_samples_are_not_bridged():
    log = exact_log(swinging_motion())
    kept = (log.t_s < 3.0) | (log.t_s > 3.2)
    saturated = np.abs(log.t_s - 7.0) < 1e-6
    log = replace(
        log,
        t_s=log.t_s[kept],
        rate_rad_s=log.rate_rad_s[kept],
        force_m_s2=log.force_m_s2[kept],
        saturated=saturated[kept],
    )
    imu = imu_at_camera(log, MOUNT, None, CONFIG)
    start, end = (
        np.array([-0.6, 0.0, 2.5, 3.05, 3.25, 6.5, 7.1, 9.0]),
        np.array([1.0, 2.9, 3.05, 3.15, 6.9, 7.5, 9.0, 10.6]),
    )
    np.testing.assert_array_equal(
        imu.covers(start, end), [False, True, False, False, True, False, True, False]
    )


def test_noise_comes_from_the_log_the_rig_or_the_lower_bound():
    rng, log = np.random.default_rng(0), exact_log(swinging_motion())
    noisy = replace(log, rate_rad_s=log.rate_rad_s + rng.normal(0.0, 0.05, log.rate_rad_s.shape))
    found = imu_at_camera(noisy, MOUNT, None, CONFIG)
    assert found.gyro_density == pytest.approx(0.05 / np.sqrt(200.0), rel=0.1)
    assert found.accelerometer_density == CONFIG.accelerometer_density
    stated = imu_at_camera(noisy, replace(MOUNT, gyro_density=0.02), None, CONFIG)
    assert stated.gyro_density == 0.02

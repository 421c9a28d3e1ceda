import numpy as np
import pytest
from inertial import GRAVITY_M_S2, MOUNT, exact_log, swinging_motion

from vgps.simulate import SCENES, AccelerometerConfig, build_motion
from vgps.simulate.accelerometer import (
    simulate_accelerometer,
    simulate_imu,
    specific_force,
    with_scale_errors,
)
from vgps.simulate.sensors import simulate_gyro


def test_the_force_is_that_of_the_sensors_own_path():
    motion = swinging_motion()
    camera_p_imu = -MOUNT.imu_R_camera.T @ MOUNT.imu_p_camera
    log = exact_log(motion)
    force = specific_force(motion, log.t_s, camera_p_imu, GRAVITY_M_S2)
    np.testing.assert_allclose(force @ MOUNT.imu_R_camera.T, log.force_m_s2, atol=1e-4)


@pytest.mark.slow
def test_noise_bias_and_gravity():
    scene, config = SCENES["walk"], AccelerometerConfig(noise_m_s2=0.05, bias_m_s2=0.2)
    motion = build_motion(scene, np.random.default_rng(0))
    t = np.arange(0.0, 60.0, 0.005)

    def force(settings, seed=1):
        return simulate_accelerometer(motion, scene, settings, t, np.random.default_rng(seed))[0]

    quiet = AccelerometerConfig(noise_m_s2=0.0, bias_m_s2=0.0, bias_walk_m_s2_sqrt_s=0.0)
    exact = force(quiet)
    noisy, bias = simulate_accelerometer(motion, scene, config, t, np.random.default_rng(1))
    white = noisy - exact - bias
    assert np.abs(white.mean(axis=0)).max() < 0.003 and white.std() == pytest.approx(0.05, rel=0.02)
    assert np.linalg.norm(exact, axis=1).mean() == pytest.approx(9.8, abs=0.2)
    errors = np.stack([force(config, seed) - exact for seed in range(20)])
    assert np.diff(errors, axis=1).std() == pytest.approx(0.05 * np.sqrt(2.0), rel=0.02)
    assert errors.mean(axis=1).std() == pytest.approx(0.2, rel=0.25)


def test_scales_and_axes_are_off_and_the_mean_share_is_bias():
    rng = np.random.default_rng(0)
    exact, bias = rng.normal([0.0, 0.0, 9.8], 1.0, (500, 3)), np.linspace([0.1] * 3, [2.1] * 3, 500)
    matrices = []
    for seed in range(50):
        samples, found = with_scale_errors(exact + bias, bias, 0.005, np.random.default_rng(seed))
        left = samples - exact - found
        np.testing.assert_allclose(left.mean(axis=0), 0.0, atol=1e-12)
        matrices.append(np.linalg.lstsq(exact - exact.mean(axis=0), left, rcond=None)[0])
        np.testing.assert_allclose(matrices[-1], matrices[-1].T, atol=1e-12)
    assert np.std(matrices) == pytest.approx(0.005, rel=0.15)


def test_gyro_and_accelerometer_of_an_imu_have_scale_errors():
    scene = SCENES["demo"]
    motion = build_motion(scene, np.random.default_rng(0))
    gyro = simulate_gyro(motion, scene, np.random.default_rng(1))

    def measured(scale_error):
        config = AccelerometerConfig(scale_error=scale_error)
        scaled, force, _ = simulate_imu(motion, scene, config, gyro, np.random.default_rng(2))
        return scaled.rate_rad_s, force

    for true, scaled in zip(measured(0.0), measured(0.02), strict=True):
        assert 0.003 < np.abs(scaled - true).max() / np.abs(true).max() < 0.1
    np.testing.assert_array_equal(measured(0.0)[0], gyro.rate_rad_s)

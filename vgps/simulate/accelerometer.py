"""The accelerometer beside the gyro of a simulated recording."""

import numpy as np

from vgps.geodesy import normal_gravity
from vgps.model import FloatArray
from vgps.simulate.motion import Motion
from vgps.simulate.scene import SceneConfig
from vgps.simulate.sensor_config import AccelerometerConfig
from vgps.simulate.sensors import SimulatedGyro, gyro_R_camera

_STEP_S = 1e-3  # of the difference quotient of the angular rates


def specific_force(motion: Motion, t_s: FloatArray, camera_p_imu: FloatArray, gravity: float) -> FloatArray:
    """Return the exact specific force (N, 3) at a point of the camera, in the camera's axes, m/s^2.

    Args:
        motion: Of the camera.
        t_s: (N,) times.
        camera_p_imu: (3,) metres.
        gravity: Its size, m/s^2.
    """
    rate = motion.rates(t_s)
    angular = (motion.rates(t_s + _STEP_S) - motion.rates(t_s - _STEP_S)) / (2.0 * _STEP_S)
    world = motion.spline(t_s, 2)[:, :3] + [0.0, 0.0, gravity]
    at_camera = np.einsum("nji,nj->ni", motion.poses(t_s)[:, :3, :3], world)
    arm = np.cross(angular, camera_p_imu) + np.cross(rate, np.cross(rate, camera_p_imu))
    return np.asarray(at_camera + arm)


def simulate_imu(
    motion: Motion,
    config: SceneConfig,
    accelerometer: AccelerometerConfig,
    gyro: SimulatedGyro,
    rng: np.random.Generator,
) -> tuple[SimulatedGyro, FloatArray, FloatArray]:
    """Return the gyro with scale errors, specific force (N, 3) and its bias (N, 3), in the gyro's axes.

    Args:
        motion, config, accelerometer: As for :func:`simulate_accelerometer`.
        gyro: Without scale errors.
        rng: Random generator.
    """
    measured = simulate_accelerometer(motion, config, accelerometer, gyro.t_s, rng)
    force, bias = with_scale_errors(*measured, accelerometer.scale_error, rng)
    rates = with_scale_errors(gyro.rate_rad_s, gyro.bias_rad_s, accelerometer.scale_error, rng)
    return SimulatedGyro(gyro.t_s, *rates), force, bias


def simulate_accelerometer(
    motion: Motion,
    config: SceneConfig,
    accelerometer: AccelerometerConfig,
    t_s: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return specific force (N, 3), with noise and a walking bias, and the bias (N, 3), in the gyro's axes.

    Args:
        motion: Of the camera.
        config: The scene, with the gyro's housing.
        accelerometer: Errors and place.
        t_s: (N,) times.
        rng: Random generator.
    """
    imu_R_camera = gyro_R_camera(config.gyro)
    camera_p_imu = -imu_R_camera.T @ np.array(accelerometer.imu_p_camera)
    exact = specific_force(motion, t_s, camera_p_imu, normal_gravity(config.world_origin))
    steps = accelerometer.bias_walk_m_s2_sqrt_s / np.sqrt(config.gyro.rate_hz)
    walk = np.cumsum(steps * rng.standard_normal(exact.shape), axis=0)
    bias = accelerometer.bias_m_s2 * rng.standard_normal(3) + walk
    white = accelerometer.noise_m_s2 * rng.standard_normal(exact.shape)
    return exact @ imu_R_camera.T + bias + white, bias


def with_scale_errors(
    samples: FloatArray, bias: FloatArray, sigma: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return samples (N, 3) of a sensor whose scales and axes are off, and their bias (N, 3).

    The errors are a symmetric matrix: its antisymmetric part would be a rotation, and belong to the mounting.
    What they make of the mean sample is constant and counts as bias.

    Args:
        samples: Measured, with a bias (N, 3).
        bias: That bias.
        sigma: Standard deviation of the elements of the matrix.
        rng: Random generator.
    """
    lower = np.tril(sigma * rng.standard_normal((3, 3)))
    error = (samples - bias) @ (lower + np.tril(lower, -1).T)
    return samples + error, bias + error.mean(axis=0)

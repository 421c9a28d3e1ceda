"""The accelerometer beside the gyro of a simulated recording."""

import numpy as np

from vgps.geodesy import normal_gravity
from vgps.model import FloatArray
from vgps.simulate.motion import Motion
from vgps.simulate.scene import SceneConfig
from vgps.simulate.sensor_config import AccelerometerConfig
from vgps.simulate.sensors import gyro_R_camera

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

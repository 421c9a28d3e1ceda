"""A camera that turns in a known way, and a gyro on it whose mount, clock and bias are known."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry.angular_rates import RelativeRotations
from vgps.gyro_calibration import Mount
from vgps.model import FloatArray, GyroLog

# far from the identity, from its inverse and from any permutation of the axes
MOUNT = Mount(
    Rotation.from_euler("xyz", [100.0, -35.0, 62.0], degrees=True).as_matrix(),
    0.137,
    np.array([0.02, -0.013, 0.007]),
)
FRAME_S = 1 / 20

Rates = Callable[[FloatArray], FloatArray]


def rich(t_s: FloatArray) -> FloatArray:
    """(N, 3) rates about the camera's axes that are never alike, rad/s."""
    waves = [np.sin(2.1 * t_s) + 0.4 * np.sin(5.3 * t_s), 0.8 * np.cos(1.3 * t_s + 0.3 * np.sin(t_s))]
    return np.stack([*waves, 0.6 * np.sin(3.7 * t_s + 1.0) + 0.05 * t_s], axis=-1) * 0.5


def one_axis(t_s: FloatArray) -> FloatArray:
    """A pan alone, about an axis that is none of the camera's."""
    return rich(t_s)[:, :1] * np.array([[0.36, 0.48, 0.8]])


def camera_rotations(
    rates: Rates, seconds: float, noise_rad: float = 0.0, rng: np.random.Generator | None = None
) -> RelativeRotations:
    """The camera's turns at 20 frames a second, in 40 short steps of the exact exponential each."""
    frames, steps = round(seconds / FRAME_S), 40
    start = FRAME_S * np.arange(frames)
    turn = Rotation.identity(frames)
    for k in range(steps):
        turn = turn * Rotation.from_rotvec(rates(start + FRAME_S * (k + 0.5) / steps) * FRAME_S / steps)
    if rng is not None:
        turn = turn * Rotation.from_rotvec(noise_rad * rng.normal(size=(frames, 3)))
    covariance = np.tile(max(noise_rad, 1e-6) ** 2 * np.eye(3), (frames, 1, 1))
    return RelativeRotations(
        start_s=start, end_s=start + FRAME_S, start_R_end=turn.as_matrix(), covariance=covariance, missed=0
    )


def gyro_log(
    rates: Rates,
    seconds: float,
    mount: Mount = MOUNT,
    noise_rad_s: float = 0.0,
    rng: np.random.Generator | None = None,
) -> GyroLog:
    """What the gyro says at 200 Hz, from a second before the first frame to one after the last."""
    t_s = np.arange(-1.0, seconds + 1.0, 0.005)
    rate = rates(t_s) @ mount.gyro_R_camera.T + mount.bias_rad_s
    if rng is not None:
        rate = rate + noise_rad_s * rng.normal(size=rate.shape)
    return GyroLog(t_s - mount.time_offset_s, rate, Path("gyro.csv"))


NOISE = 1e-3  # rad, of a rotation from the image


def noisy(rates, seconds=15.0, seed=0):
    rng = np.random.default_rng(seed)
    return camera_rotations(rates, seconds, NOISE, rng), gyro_log(rates, seconds, noise_rad_s=2e-3, rng=rng)

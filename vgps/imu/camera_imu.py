"""An IMU's samples as a sensor at the camera's centre, with the camera's axes, would have measured them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgps.config import ImuConfig
from vgps.geodesy import normal_gravity
from vgps.model import BoolArray, FloatArray, GeodeticPoint, ImuLog, ImuMount
from vgps.readers.imu import GAP_INTERVALS

STANDARD_GRAVITY_M_S2 = 9.80665
_SQUARED_SECOND_DIFFERENCE = 6.0  # variance of a second difference of white noise of variance 1
_MAD_SHARE = 0.6745  # median of the absolute value of a standard normal variable


@dataclass(frozen=True, kw_only=True)
class CameraImu:
    """Angular rates and specific force at the camera's centre, in the camera's axes.

    Attributes:
        t_s: (N,) strictly ascending, on the video's clock.
        rate_rad_s: (N, 3).
        force_m_s2: (N, 3) acceleration minus gravity.
        broken: (N - 1,) whether a gap or saturation lies between a sample and the next.
        gravity_m_s2: Size of gravity.
        gyro_density, accelerometer_density: White noise, per sqrt(Hz).
        bias: (6,) expected bias of force and rates.
        source: The file.
    """

    t_s: FloatArray
    rate_rad_s: FloatArray
    force_m_s2: FloatArray
    broken: BoolArray
    gravity_m_s2: float
    gyro_density: float
    accelerometer_density: float
    bias: FloatArray
    source: Path = Path()

    def covers(self, start_s: FloatArray, end_s: FloatArray) -> BoolArray:
        """Return whether samples cover each interval (P,) from (P,) to (P,) without a break."""
        inside = (start_s >= self.t_s[0]) & (end_s <= self.t_s[-1])
        breaks = np.concatenate([[0], np.cumsum(self.broken)])
        first = np.clip(np.searchsorted(self.t_s, start_s, side="right") - 1, 0, len(self.broken))
        last = np.clip(np.searchsorted(self.t_s, end_s, side="left"), 0, len(self.broken))
        return np.asarray(inside & (breaks[last] == breaks[first]))


def used_imu(
    log: ImuLog | None, mount: ImuMount | None, origin: GeodeticPoint | None, config: ImuConfig
) -> CameraImu | None:
    """Return the IMU at the camera; None without a log or a mounting, or if it is not to be used."""
    if log is None or mount is None or config.use == "no":
        return None
    return imu_at_camera(log, mount, origin, config)


def imu_at_camera(log: ImuLog, mount: ImuMount, origin: GeodeticPoint | None, config: ImuConfig) -> CameraImu:
    """Return the samples that a sensor at the camera's centre would have measured.

    ``f_camera = R^T (f + w' x p + w x (w x p))`` with the camera at p in the IMU's frame. The angular
    acceleration w' is the difference of successive rates: its noise, integrated, is that of two samples only.

    Args:
        log: On the video's clock.
        mount: Where the camera is in the IMU's frame, and what is known of biases and noise.
        origin: Place on the earth, for the size of gravity; None if it is not known.
        config: Lower bounds of the noise.
    """
    R, p = mount.imu_R_camera, mount.imu_p_camera
    rate = log.rate_rad_s - mount.gyro_bias_rad_s
    angular_acceleration = np.gradient(rate, log.t_s, axis=0)
    force = log.force_m_s2 + np.cross(angular_acceleration, p) + np.cross(rate, np.cross(rate, p))
    step_s = np.diff(log.t_s)
    interval_s = float(np.median(step_s))
    broken = step_s > GAP_INTERVALS * interval_s
    broken |= log.saturated[:-1] | log.saturated[1:]
    of_log = noise_densities(log)
    gyro = mount.gyro_density or of_log[0]
    accelerometer = mount.accelerometer_density or of_log[1]
    return CameraImu(
        t_s=log.t_s,
        rate_rad_s=log.rate_rad_s @ R,
        force_m_s2=force @ R,
        broken=broken,
        gravity_m_s2=STANDARD_GRAVITY_M_S2 if origin is None else normal_gravity(origin),
        gyro_density=max(gyro, config.gyro_density),
        accelerometer_density=max(accelerometer, config.accelerometer_density),
        source=log.source,
        bias=np.concatenate([mount.accelerometer_bias_m_s2 @ R, mount.gyro_bias_rad_s @ R]),
    )


def noise_densities(log: ImuLog) -> tuple[float, float]:
    """Return the white noise of rates [rad/s/sqrt(Hz)] and specific force [m/s^2/sqrt(Hz)] in a log."""
    interval_s = float(np.median(np.diff(log.t_s)))
    return _density(log.rate_rad_s, interval_s), _density(log.force_m_s2, interval_s)


def _density(samples: FloatArray, interval_s: float) -> float:
    """Return the white noise of samples (N, 3) per sqrt(Hz), from their second differences.

    Motion is smooth from sample to sample, vibration is not: it counts as noise.
    """
    second = np.abs(samples[2:] - 2.0 * samples[1:-1] + samples[:-2])
    sigma = np.median(second, axis=0) / _MAD_SHARE / np.sqrt(_SQUARED_SECOND_DIFFERENCE)
    return float(sigma.max() * np.sqrt(interval_s)) if len(second) else 0.0

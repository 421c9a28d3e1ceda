"""Whether an IMU turned as a path did: a wrong mounting or clock is named before it bends the path."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry.angular_rates import GyroIntegral, RelativeRotations
from vgps.imu.camera_imu import CameraImu
from vgps.imu.mount_fit import Fit, Mount, fit_mount
from vgps.model import FloatArray, GyroLog
from vgps.solution import Trajectory

_INTERVAL_S = 0.1  # a rotation must exceed its own error
_MIN_INTERVALS = 30
_PATH_SIGMA_RAD = np.radians(0.05)  # of a rotation of the path over an interval
_MIN_VARIATION_RAD_S = 0.02  # rates that vary less show neither mounting nor clock
_MIN_CORRELATION, _CLEAR_CORRELATION = 0.5, 0.8
_LAGS_S = 0.05 * np.arange(-100, 101)  # of a clock that is looked for where rates hardly correlate
_MAX_RATIO = 2.0
_ROBUST_SIGMAS = 2.5
_MAX_ROTATION_DEG, _MAX_OFFSET_S, _SIGMAS = 2.0, 0.02, 3.0  # beyond which an IMU harms more than it helps
_LEAST_OFFSET_S = 1e-3  # of a clock that is worth a correction: 0.15 degrees in a fast turn of 150 deg/s


class Agreement(NamedTuple):
    """What the rotations of a path say of an IMU.

    Attributes:
        contradiction: Of mounting or unit; None if there is none.
        time_offset_s: To be added to the IMU's times; 0 if it is not significant.
        time_offset_sigma_s: Its standard deviation.
    """

    contradiction: str | None
    time_offset_s: float = 0.0
    time_offset_sigma_s: float = 0.0

    @property
    def shown(self) -> bool:
        """Whether the rotations were enough to say anything."""
        return self.contradiction is not None or self.time_offset_sigma_s > 0.0

    @property
    def misled(self) -> bool:
        """Whether the clock was so far off that the rotations which the IMU predicted were wrong."""
        return abs(self.time_offset_s) > _MAX_OFFSET_S


def agreement(rotations: RelativeRotations, imu: CameraImu) -> Agreement:
    """Compare an IMU's rotations with the video's: unit, mounting and clock.

    Args:
        rotations: Of the camera.
        imu: Samples in the camera's axes, as the rig mounts it.
    """
    integral = GyroIntegral(GyroLog(imu.t_s, imu.rate_rad_s, imu.source))
    by_path, by_gyro = _rates(rotations, integral, imu, 0.0)
    if len(by_path) < _MIN_INTERVALS or np.linalg.norm(by_path.std(axis=0)) < _MIN_VARIATION_RAD_S:
        return Agreement(None)
    lag_s = 0.0
    if _correlation(by_path, by_gyro) < _CLEAR_CORRELATION:
        correlations = [_correlation(*_rates(rotations, integral, imu, lag)) for lag in _LAGS_S.tolist()]
        if max(correlations) > _CLEAR_CORRELATION:
            lag_s = float(_LAGS_S[int(np.argmax(correlations))])
            by_path, by_gyro = _rates(rotations, integral, imu, lag_s)
    correlation = _correlation(by_path, by_gyro)
    if correlation < _MIN_CORRELATION:
        return Agreement(f"its rates and those of the video correlate to {correlation:.2f} only")
    ratio = float(np.linalg.norm(by_gyro.std(axis=0)) / np.linalg.norm(by_path.std(axis=0)))
    if not 1.0 / _MAX_RATIO < ratio < _MAX_RATIO:
        return Agreement(f"it turns {ratio:.3g} times as far as the video (rates in rad/s are expected)")
    rotations = _covered(rotations, imu, lag_s)
    fit = fit_mount(rotations, integral, Mount(np.eye(3), lag_s, imu.bias[3:]), _ROBUST_SIGMAS)
    offset_s, sigma_s = fit.mount.time_offset_s, float(np.sqrt(fit.covariance[3, 3]))
    if abs(offset_s) < max(_SIGMAS * sigma_s, _LEAST_OFFSET_S):
        offset_s = 0.0
    return Agreement(_difference(fit), offset_s, sigma_s)


def path_rotations(paths: Sequence[Trajectory]) -> RelativeRotations:
    """Return rotations over intervals of pieces of a path.

    Args:
        paths: Each in a frame of its own; NaN where a pose is unknown.
    """
    start_s, end_s, relative = [np.zeros(0)], [np.zeros(0)], [np.zeros((0, 3, 3))]
    for path in paths:
        known = np.isfinite(path.world_T_camera[:, 0, 0])
        t_s, rotation = path.t_s[known], path.world_T_camera[known, :3, :3]
        at = np.unique(np.searchsorted(t_s, np.arange(t_s[0], t_s[-1], _INTERVAL_S) - 1e-6))
        near = np.diff(t_s[at]) < 2.0 * _INTERVAL_S
        start_s.append(t_s[at][:-1][near])
        end_s.append(t_s[at][1:][near])
        relative.append((rotation[at[:-1]].transpose(0, 2, 1) @ rotation[at[1:]])[near])
    start, end = np.concatenate(start_s), np.concatenate(end_s)
    covariance = np.tile(_PATH_SIGMA_RAD**2 * np.eye(3), (len(start), 1, 1))
    return RelativeRotations(
        start_s=start, end_s=end, start_R_end=np.concatenate(relative), covariance=covariance, missed=0
    )


def _covered(rotations: RelativeRotations, imu: CameraImu, lag_s: float) -> RelativeRotations:
    """Return the rotations that samples cover if about ``lag_s`` is added to their times."""
    margin_s = _INTERVAL_S + lag_s
    return rotations.where(imu.covers(rotations.start_s - margin_s, rotations.end_s + _INTERVAL_S - lag_s))


def _rates(
    rotations: RelativeRotations, integral: GyroIntegral, imu: CameraImu, lag_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the mean rates (n, 3) of path and gyro over the intervals that samples cover, rad/s."""
    shown = _covered(rotations, imu, lag_s)
    return shown.mean_rates(), integral.mean_rates(shown.start_s - lag_s, shown.end_s - lag_s)


def _correlation(a: FloatArray, b: FloatArray) -> float:
    """Return the correlation of rates (n, 3), all axes together; 0 of too few."""
    if len(a) < _MIN_INTERVALS:
        return 0.0
    a, b = a - np.median(a, axis=0), b - np.median(b, axis=0)
    return float(np.sum(a * b) / np.sqrt(np.sum(a**2) * np.sum(b**2)))


def _difference(fit: Fit) -> str | None:
    """Return the rotation that the fit finds, if it is significant and large."""
    sigma = np.sqrt(np.diag(fit.covariance))
    turn = np.degrees(Rotation.from_matrix(fit.mount.gyro_R_camera).as_rotvec())
    shown = np.abs(turn) > _SIGMAS * np.degrees(sigma[:3])
    if np.linalg.norm(turn[shown]) <= _MAX_ROTATION_DEG:
        return None
    about = ", ".join(f"{angle:.1f}" for angle in turn)
    return f"it is mounted otherwise than imu_R_camera says, by {about} degrees about the camera's axes"

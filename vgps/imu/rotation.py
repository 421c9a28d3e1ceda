"""Rotation of the camera between frames by the gyro, whose bias the path itself gives."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import ImuConfig
from vgps.geometry.angular_rates import GyroIntegral
from vgps.imu.camera_imu import CameraImu
from vgps.model import FloatArray, GyroLog
from vgps.solution import Trajectory

BIAS_FRAMES = 300  # last frames that give the bias
_BIAS_INTERVALS = 60  # between them that are compared
_FEWEST = 10  # intervals that give it: the first poses of a map are rough
_BIAS_SIGMA = 0.005  # rad/s, of the bias that they give
_CLOSE_RAD_S = 0.05  # rates that differ by less agree, whatever the motion: a third of a degree in 0.1 s


@dataclass(frozen=True)
class GyroBias:
    """A bias (3,) and its standard deviation on each axis, rad/s."""

    rate_rad_s: FloatArray
    sigma_rad_s: float


@dataclass(frozen=True)
class PredictedRotation:
    """A rotation (3, 3) and its standard deviation about each axis, rad."""

    rotation: FloatArray
    sigma_rad: float


class RotationPredictor:
    """Prediction of the camera's rotation by its gyro.

    Args:
        imu: Samples at the camera.
        config: Errors of the gyro.

    Attributes:
        integral: Of the rates.
    """

    def __init__(self, imu: CameraImu, config: ImuConfig) -> None:
        self._imu, self._config = imu, config
        self.integral = GyroIntegral(GyroLog(imu.t_s, imu.rate_rad_s, imu.source))

    def predict(self, path: Trajectory, t_s: float) -> PredictedRotation | None:
        """Return the camera's rotation from its axes at a later time to those of the last frame.

        The bias is the median difference between the rates of gyro and path, or the expected one where there
        are few frames.

        Args:
            path: Frames so far, NaN where a pose is unknown.
            t_s: The time.

        Returns:
            The rotation; None where the gyro has no samples, or turned otherwise than the last frames.
        """
        last_s, bias = float(path.t_s[-1]), self.bias(path)
        if bias is None:
            return None
        rotation = self.between(last_s, t_s, bias.rate_rad_s)
        if rotation is None:
            return None
        angle = float(Rotation.from_matrix(rotation).magnitude())
        sigma = rotation_sigma_rad(self._imu, t_s - last_s, max(bias.sigma_rad_s, _BIAS_SIGMA))
        return PredictedRotation(rotation, float(np.hypot(sigma, self._config.scale_error * angle)))

    def between(self, start_s: float, end_s: float, bias: FloatArray | None = None) -> FloatArray | None:
        """Return the camera's rotation between two times, start_R_end (3, 3); None without samples.

        Args:
            start_s, end_s: The times.
            bias: (3,) of the rates; the expected one if none is given.
        """
        span = np.array([start_s]), np.array([end_s])
        if not self._imu.covers(*span)[0]:
            return None
        bias = self._imu.bias[3:] if bias is None else bias
        return np.asarray(self.integral.relative_rotations(*span, bias)[0])

    def bias(self, path: Trajectory) -> GyroBias | None:
        """Return the bias by the last frames; None if they turned otherwise than the gyro.

        Few frames do not show it: then it is the expected one.
        """
        known = np.flatnonzero(np.isfinite(path.world_T_camera[-BIAS_FRAMES:, 0, 0]))
        known = known[:: max(1, len(known) // _BIAS_INTERVALS)]
        t_s, rotation = path.t_s[-BIAS_FRAMES:][known], path.world_T_camera[-BIAS_FRAMES:, :3, :3][known]
        kept = self._imu.covers(t_s[:-1], t_s[1:])
        if kept.sum() < _FEWEST:
            return GyroBias(self._imu.bias[3:], self._config.gyro_bias_sigma)
        start_s, end_s = t_s[:-1][kept], t_s[1:][kept]
        by_gyro = self.integral.relative_rotations(start_s, end_s)
        by_path = rotation[:-1][kept].transpose(0, 2, 1) @ rotation[1:][kept]
        interval_s = (end_s - start_s)[:, None]
        off = Rotation.from_matrix(by_path.transpose(0, 2, 1) @ by_gyro).as_rotvec() / interval_s
        turned = Rotation.from_matrix(by_path).as_rotvec() / interval_s
        bias = np.median(off, axis=0)
        wrong, varies = _size(off - bias), _size(turned - np.median(turned, axis=0))
        sigma = min(_BIAS_SIGMA, _size(off - bias) / np.sqrt(len(off)))
        return None if wrong > max(varies, _CLOSE_RAD_S) else GyroBias(bias, sigma)


def rotation_sigma_rad(imu: CameraImu, interval_s: float, bias_sigma: float = _BIAS_SIGMA) -> float:
    """Return the standard deviation of a small rotation by the gyro, with the bias that a path gives."""
    return float(np.hypot(imu.gyro_density * np.sqrt(interval_s), bias_sigma * interval_s))


def _size(rates: FloatArray) -> float:
    """Return the median size of rates (N, 3)."""
    return float(np.median(np.linalg.norm(rates, axis=1)))

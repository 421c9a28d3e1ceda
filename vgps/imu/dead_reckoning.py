"""The camera's pose by its IMU alone, for a while after a path ends.

Over the last seconds of the path p the specific force, integrated twice, has to give its movement:

``int (1 + s(t)) dp = v t + int int (R (f - b) - g) + d t^2 / 2``

with the unknown velocity v, bias b of the accelerometer, tilt d of the path (as an acceleration) and error s
of its scale, which walks at random: a robust linear fit to the path's steps, carried on with the gyro.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from vgps.config import ImuConfig
from vgps.geometry import interpolate_poses, interpolate_vectors
from vgps.imu.camera_imu import CameraImu
from vgps.imu.rotation import RotationPredictor
from vgps.model import FloatArray
from vgps.solution import Trajectory

_FIT_S, _SHORTEST_S = 4.0, 1.0  # of the path that is fitted; over longer ones the video drifts
_STEP_SIGMA_M = 0.005  # of the path from frame to frame, at least
_ROUNDS, _ROBUST = 5, 2.0  # Cauchy's constant, in sigmas: where an optimised window ends, the path may step
_MEDIAN_LENGTH = 1.538  # median length of a standard normal vector in space
_KNOTS = 1 + round(2.0 * _FIT_S)  # at which the error of the scale is unknown; the last is the path's end
_VELOCITY, _BIAS, _TILT = (slice(k, k + 3) for k in range(0, 9, 3))
_SCALE, _UNKNOWNS = slice(9, 9 + _KNOTS), 9 + _KNOTS


class PathErrors(NamedTuple):
    """Standard deviations of a path's tilt [rad] and of its log scale at its end, which walks by
    ``scale_walk`` times the square root of the seconds."""

    tilt_rad: float
    scale: float
    scale_walk: float


class Reckoned(NamedTuple):
    """A pose after the end of a path, and the errors that have come to those of its last pose.

    Attributes:
        world_T_camera: (4, 4).
        covariance_m2: (3, 3) of the movement since the last pose.
        sigma_rad: Standard deviation of the rotation since then, about each axis.
    """

    world_T_camera: FloatArray
    covariance_m2: FloatArray
    sigma_rad: float


class DeadReckoning:
    """Poses after the end of a path by an IMU.

    Args:
        imu: Samples at the camera.
        config: Errors of the accelerometer.
    """

    def __init__(self, imu: CameraImu, config: ImuConfig) -> None:
        self._imu, self._config = imu, config
        self._rotation = RotationPredictor(imu, config)

    def pose(self, path: Trajectory, errors: PathErrors, t_s: float) -> Reckoned | None:
        """Return the pose at a time after the end of a path.

        Args:
            path: World_T_camera, z up; without frames that were bridged themselves.
            errors: Of the path.
            t_s: The time.

        Returns:
            The pose; None if the IMU does not cover the time, or turned otherwise than the path, or if the
            path is too short to show a velocity.
        """
        last_s, gyro = float(path.t_s[-1]), self._rotation.bias(path)
        window = path.t_s >= last_s - _FIT_S
        path = Trajectory(path.t_s[window], path.world_T_camera[window])
        start_s, away_s = float(path.t_s[0]), t_s - last_s
        covered = self._imu.covers(np.array([start_s]), np.array([t_s]))[0]
        if gyro is None or last_s - start_s < _SHORTEST_S or not covered:
            return None
        samples = self._imu.t_s[(self._imu.t_s > start_s) & (self._imu.t_s < t_s)]
        times = np.unique(np.concatenate([path.t_s, samples, [t_s]]))
        R = self._rotations(path, times, gyro.rate_rad_s)
        force = interpolate_vectors(self._imu.t_s, self._imu.force_m_s2 - self._imu.bias[:3], times)
        acceleration = (R @ force[:, :, None])[:, :, 0] - [0.0, 0.0, self._imu.gravity_m_s2]
        moved, J = _integrated_twice(times, acceleration), _jacobians(times, R)
        rows = np.searchsorted(times, path.t_s)
        x, covariance = self._fitted(path, moved[rows], J[rows], errors)
        since = J[-1] - J[rows[-1]]
        pose = np.eye(4)
        pose[:3, :3] = R[-1]
        pose[:3, 3] = path.world_T_camera[-1, :3, 3] + moved[-1] - moved[rows[-1]] + since @ x
        angle = float(Rotation.from_matrix(R[rows[-1]].T @ R[-1]).magnitude())
        noise = self._imu.gyro_density * np.sqrt(away_s), self._config.scale_error * angle
        sigma_rad = float(np.linalg.norm([*noise, gyro.sigma_rad_s * away_s]))
        added = self._noise_variance(away_s, gyro.sigma_rad_s)
        return Reckoned(pose, since @ covariance @ since.T + added * np.eye(3), sigma_rad)

    def least_sigma_m(self, away_s: float) -> float:
        """Return what noise alone adds to the standard deviation of a position after some seconds."""
        return float(np.sqrt(3.0 * self._noise_variance(away_s)))

    def _rotations(self, path: Trajectory, times: FloatArray, bias_rad_s: FloatArray) -> FloatArray:
        """Return the camera's rotations (T, 3, 3): of the path, and after its end by the gyro."""
        R = interpolate_poses(path.t_s, path.world_T_camera, times)[:, :3, :3]
        last = int(np.searchsorted(times, path.t_s[-1]))
        rate, step_s = self._rotation.integral.steps(float(times[last]), float(times[-1]))
        turns = Rotation.from_rotvec((rate - bias_rad_s) * step_s[:, None]).as_matrix()
        for row, turn in enumerate(turns, last + 1):
            R[row] = R[row - 1] @ turn
        return R

    def _fitted(
        self, path: Trajectory, moved: FloatArray, J: FloatArray, errors: PathErrors
    ) -> tuple[FloatArray, FloatArray]:
        """Return the unknowns (U,) that fit a path, and their covariance (U, U)."""
        steps = np.diff(path.world_T_camera[:, :3, 3], axis=0)
        J, expected = np.diff(J, axis=0), np.diff(moved, axis=0)
        J[:, :, _SCALE] = -steps[:, :, None] * _scale_shares(path.t_s)[:, None, :]
        x, weight = np.zeros(_UNKNOWNS), np.full(len(steps), _STEP_SIGMA_M**-2)
        prior = self._prior_information(path, errors)
        for _ in range(_ROUNDS):
            covariance = np.linalg.inv(np.einsum("n,nij,nik->jk", weight, J, J) + prior)
            x = covariance @ np.einsum("n,nij,ni->j", weight, J, steps - expected)
            away = np.linalg.norm(J @ x + expected - steps, axis=1)
            sigma = max(_STEP_SIGMA_M, float(np.median(away)) / _MEDIAN_LENGTH)
            weight = 1.0 / (sigma**2 + (away / _ROBUST) ** 2)
        return x, covariance

    def _prior_information(self, path: Trajectory, errors: PathErrors) -> FloatArray:
        """Return the information (U, U) of what is known of the unknowns before."""
        information = np.zeros((_UNKNOWNS, _UNKNOWNS))
        information[_BIAS, _BIAS] = np.eye(3) * self._config.accelerometer_bias_sigma**-2
        information[_TILT, _TILT] = np.eye(3) * (errors.tilt_rad * self._imu.gravity_m_s2) ** -2
        walk = np.diff(np.eye(_KNOTS), axis=0) / errors.scale_walk
        information[_SCALE, _SCALE] = walk.T @ walk * (_KNOTS - 1) / (path.t_s[-1] - path.t_s[0])
        information[-1, -1] += errors.scale**-2
        return information

    def _noise_variance(self, away_s: float, gyro_sigma_rad_s: float = 0.0) -> float:
        """Return the variance on each axis by noise of both sensors, and by the gyro's bias: it tilts."""
        gravity = self._imu.gravity_m_s2
        tilted = gravity * np.array(
            [gyro_sigma_rad_s * away_s**3 / 6.0, self._imu.gyro_density * np.sqrt(away_s**5 / 20.0)]
        )
        return float(self._imu.accelerometer_density**2 * away_s**3 / 3.0 + tilted @ tilted)


def _integrated_twice(times: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return the movement (T, ...) from rest at the first time by accelerations (T, ...)."""
    velocity = cumulative_trapezoid(acceleration, times, axis=0, initial=0)
    return np.asarray(cumulative_trapezoid(velocity, times, axis=0, initial=0))


def _jacobians(times: FloatArray, R: FloatArray) -> FloatArray:
    """Return the derivatives (T, 3, U) of positions by the unknowns; the scale does not move the camera."""
    J, since_s = np.zeros((len(times), 3, _UNKNOWNS)), (times - times[0])[:, None, None]
    J[:, :, _VELOCITY] = since_s * np.eye(3)
    J[:, :, _BIAS] = -_integrated_twice(times, R)
    J[:, :, _TILT] = 0.5 * since_s**2 * np.eye(3)
    return J


def _scale_shares(t_s: FloatArray) -> FloatArray:
    """Return the shares (F - 1, K) of the scale's knots in the error of each step between frames at (F,)."""
    knots = np.linspace(t_s[0], t_s[-1], _KNOTS)
    return interpolate_vectors(knots, np.eye(_KNOTS), 0.5 * (t_s[1:] + t_s[:-1]))

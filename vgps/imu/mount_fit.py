"""Robust least squares for the gyro's rotation on the camera, clock offset and bias."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry.angular_rates import GyroIntegral, RelativeRotations
from vgps.model import FloatArray

_ITERATIONS = 30  # a limit: a few steps suffice from a good start
_STEPS = np.array([1e-5] * 3 + [2e-4] + [1e-5] * 3)  # of the difference quotients: rad, s, rad/s
_PRIOR = np.array([1.0] * 3 + [10.0] + [1.0] * 3) ** -2.0  # keeps unobservable parameters bounded
_MOST = np.array([0.3] * 3 + [0.02] + [0.1] * 3)  # largest step


@dataclass(frozen=True)
class Mount:
    """Rotation (3, 3) of a gyro on the camera, clock offset [s] and bias (3,) [rad/s]."""

    gyro_R_camera: FloatArray
    time_offset_s: float
    bias_rad_s: FloatArray

    def moved(self, step: FloatArray) -> "Mount":
        """Return the mount moved by a tangent (7,): rotation about the camera's axes, offset, bias."""
        rotation = self.gyro_R_camera @ Rotation.from_rotvec(step[:3]).as_matrix()
        return Mount(rotation, self.time_offset_s + float(step[3]), self.bias_rad_s + step[4:])


class Fit(NamedTuple):
    """The result of a fit.

    Attributes:
        mount: The estimate.
        covariance: (7, 7) in the tangent of `Mount.moved`; the larger of two estimates, see `fit_mount`.
        residual_rad: (P, 3) gyro's rotation minus the camera's, in the camera's axes.
        weight: (P,) of the intervals, between 0 and 1.
    """

    mount: Mount
    covariance: FloatArray
    residual_rad: FloatArray
    weight: FloatArray


def residuals(rotations: RelativeRotations, gyro: GyroIntegral, mount: Mount) -> FloatArray:
    """Return (P, 3) ``Log(camera^T gyro_R_camera^T gyro gyro_R_camera)``, Eq. (1), Matsuda 2007.

    ``camera`` and ``gyro`` are start_R_end of an interval; the result is in the camera's axes at its end.
    """
    offset, R = mount.time_offset_s, mount.gyro_R_camera
    by_gyro = gyro.relative_rotations(rotations.start_s - offset, rotations.end_s - offset, mount.bias_rad_s)
    off = rotations.start_R_end.transpose(0, 2, 1) @ R.T @ by_gyro @ R
    return np.asarray(Rotation.from_matrix(off).as_rotvec(), np.float64)


def fit_mount(rotations: RelativeRotations, gyro: GyroIntegral, start: Mount, robust_sigmas: float) -> Fit:
    """Fit the mount to the camera's rotations by Gauss-Newton with Cauchy weights.

    An interval's variance is that of its rotation from the image plus a common one from the residuals
    (rolling shutter, lens, exposure). Residuals of neighbouring intervals may be correlated: each parameter
    gets the larger of the usual variance and that of Newey and West (1987), which allows for it.

    Args:
        rotations: P intervals, all covered by the gyro at the start's offset.
        gyro: On its own clock.
        start: Initial value, with a rotation within about 20 degrees and an offset within a frame.
        robust_sigmas: Cauchy's constant.
    """
    mount = start
    for _ in range(_ITERATIONS):
        residual = residuals(rotations, gyro, mount)
        whitening, weight = _weights(residual, rotations.covariance, robust_sigmas)
        jacobian = whitening @ _jacobian(rotations, gyro, mount)
        white = (whitening @ residual[:, :, None])[:, :, 0]
        normal = np.einsum("p,pij,pik->jk", weight, jacobian, jacobian) + np.diag(_PRIOR)
        step = -np.linalg.solve(normal, np.einsum("p,pij,pi->j", weight, jacobian, white))
        mount = mount.moved(np.clip(step, -_MOST, _MOST))
        if (np.abs(step) < 1e-3 * np.sqrt(np.diag(np.linalg.inv(normal)))).all():
            break
    gradients = np.einsum("p,pij,pi->pj", weight, jacobian, white)
    return Fit(mount, _covariance(normal, gradients, weight, white), residual, weight)


def _weights(
    residual: FloatArray, covariance: FloatArray, robust_sigmas: float
) -> tuple[FloatArray, FloatArray]:
    """Return whitening matrices (P, 3, 3) and robust weights (P,)."""
    common = np.maximum(1.4826 * np.median(np.abs(residual), axis=0), 1e-6)
    total = covariance + np.diag(common**2)
    whitening = np.linalg.inv(np.linalg.cholesky(total))
    white = (whitening @ residual[:, :, None])[:, :, 0]
    return whitening, 1 / (1 + np.sum(white**2, axis=1) / (3 * robust_sigmas**2))


def _jacobian(rotations: RelativeRotations, gyro: GyroIntegral, mount: Mount) -> FloatArray:
    """Return the (P, 3, 7) Jacobian by central differences."""
    columns = []
    for step in np.diag(_STEPS):
        ahead, behind = (residuals(rotations, gyro, mount.moved(sign * step)) for sign in (1, -1))
        columns.append((ahead - behind) / (2 * step.sum()))
    return np.stack(columns, axis=2)


def _covariance(
    normal: FloatArray, gradients: FloatArray, weight: FloatArray, white: FloatArray
) -> FloatArray:
    """Return (7, 7): the larger variances of the two estimates, with the correlations of the usual one."""
    inverse, count = np.linalg.inv(normal), len(weight)
    freedom = max(1.0, 3 * weight.sum() - len(normal))
    usual = inverse * float(weight @ np.sum(white**2, axis=1)) / freedom
    lags = int(np.ceil(2 * count ** (1 / 3)))
    spread = gradients.T @ gradients
    for lag in range(1, min(lags, count - 1) + 1):
        product = gradients[lag:].T @ gradients[:-lag]
        spread += (1 - lag / (lags + 1)) * (product + product.T)
    robust = inverse @ spread @ inverse * count / max(1, count - len(normal))
    grow = np.sqrt(np.maximum(np.diag(robust) / np.diag(usual), 1.0))
    return np.asarray(usual * np.outer(grow, grow), np.float64)

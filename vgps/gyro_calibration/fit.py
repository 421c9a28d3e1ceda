"""Robust least squares over the gyro's rotation on the camera, its clock's offset and its bias."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry.angular_rates import GyroIntegral
from vgps.model import FloatArray
from vgps.tracking.relative_rotation import RelativeRotations

_ITERATIONS = 30  # a guard: from a fair start a handful of steps suffices
_STEPS = np.array([1e-5] * 3 + [2e-4] + [1e-5] * 3)  # of the difference quotients: rad, s, rad/s
_PRIOR = np.array([1.0] * 3 + [10.0] + [1.0] * 3) ** -2.0  # keeps what nothing shows from running away
_MOST = np.array([0.3] * 3 + [0.02] + [0.1] * 3)  # of one step


@dataclass(frozen=True)
class Mount:
    """How a gyro sits on the camera and how it errs: rotation (3, 3), offset of its clock [s], bias (3,)."""

    gyro_R_camera: FloatArray
    time_offset_s: float
    bias_rad_s: FloatArray

    def moved(self, step: FloatArray) -> "Mount":
        """By a tangent (7,): rotation about the camera's axes, offset, bias."""
        turned = self.gyro_R_camera @ Rotation.from_rotvec(step[:3]).as_matrix()
        return Mount(turned, self.time_offset_s + float(step[3]), self.bias_rad_s + step[4:])


class Fit(NamedTuple):
    """What came out of a fit.

    Attributes:
        mount: The best.
        covariance: (7, 7) in the tangent of `Mount.moved`; the larger of two estimates, see `fit_mount`.
        residual_rad: (P, 3) gyro's turn less the camera's, in the camera's axes.
        weight: (P,) of each interval, between 0 and 1.
    """

    mount: Mount
    covariance: FloatArray
    residual_rad: FloatArray
    weight: FloatArray


def residuals(turns: RelativeRotations, gyro: GyroIntegral, mount: Mount) -> FloatArray:
    """(P, 3) ``Log(turn^T gyro_R_camera^T gyro's turn gyro_R_camera)``, camera's axes at the end; Eq. (1),
    Matsuda 2007."""
    offset, R = mount.time_offset_s, mount.gyro_R_camera
    by_gyro = gyro.relative_rotations(turns.start_s - offset, turns.end_s - offset, mount.bias_rad_s)
    off = turns.start_R_end.transpose(0, 2, 1) @ R.T @ by_gyro @ R
    return np.asarray(Rotation.from_matrix(off).as_rotvec(), np.float64)


def fit_mount(turns: RelativeRotations, gyro: GyroIntegral, start: Mount, robust_sigmas: float) -> Fit:
    """The mount whose turns are the camera's, by Gauss-Newton with Cauchy weights.

    An interval's variance is that of its rotation from the image and, equal for all, what the residuals show
    beyond it (rolling shutter, lens, exposure). Residuals of neighbours may hang together: the covariance is
    for each parameter the larger of the usual one and that of Newey and West (1987), which allows for it.

    Args:
        turns: P intervals, all covered by the gyro at the start's offset.
        gyro: On its own clock.
        start: Close enough: rotation to some 20 degrees, offset to a frame.
        robust_sigmas: Cauchy's constant.
    """
    mount = start
    for _ in range(_ITERATIONS):
        residual = residuals(turns, gyro, mount)
        whitening, weight = _weights(residual, turns.covariance, robust_sigmas)
        jacobian = whitening @ _jacobian(turns, gyro, mount)
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
    """Whitening matrices (P, 3, 3) and robust weights (P,)."""
    common = np.maximum(1.4826 * np.median(np.abs(residual), axis=0), 1e-6)
    total = covariance + np.diag(common**2)
    whitening = np.linalg.inv(np.linalg.cholesky(total))
    white = (whitening @ residual[:, :, None])[:, :, 0]
    return whitening, 1 / (1 + np.sum(white**2, axis=1) / (3 * robust_sigmas**2))


def _jacobian(turns: RelativeRotations, gyro: GyroIntegral, mount: Mount) -> FloatArray:
    """(P, 3, 7) by central differences."""
    columns = []
    for step in np.diag(_STEPS):
        ahead, behind = (residuals(turns, gyro, mount.moved(sign * step)) for sign in (1, -1))
        columns.append((ahead - behind) / (2 * step.sum()))
    return np.stack(columns, axis=2)


def _covariance(
    normal: FloatArray, gradients: FloatArray, weight: FloatArray, white: FloatArray
) -> FloatArray:
    """(7, 7) the larger, on the diagonal, of the two estimates; the correlations are the usual one's."""
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

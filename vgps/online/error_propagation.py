"""Covariance of the errors at the newest end of a path of camera and fixes, by a Kalman filter.

Errors are those of position (3) [m], log scale, rotation (3) [rad] about the world's axes, and of the fixes
(3 for each correlation time), in units of their standard deviations. Means are not estimated: the path is
what it is, only its uncertainty is asked for.
"""

import numpy as np

from vgps.config import DriftConfig
from vgps.model import BoolArray, FloatArray

POSITION, SCALE, ROTATION = slice(0, 3), 3, slice(4, 7)
PATH_ERRORS = 7  # those of the fixes follow
_ANYWHERE_M, _ANY_SCALE, _ANY_ROTATION_RAD = 100.0, 1.0, 1.0


def unknown_covariance(correlation_times: int) -> FloatArray:
    """Return the covariance (7 + 3 C, same) of a path anywhere, of any scale and any rotation."""
    sigma = np.ones(PATH_ERRORS + 3 * correlation_times)
    sigma[POSITION], sigma[SCALE], sigma[ROTATION] = _ANYWHERE_M, _ANY_SCALE, _ANY_ROTATION_RAD
    return np.diag(sigma**2)


def with_level_axis(covariance: FloatArray, axis: FloatArray, sigma_rad: float) -> FloatArray:
    """Return the covariance when the elevation of an axis (3,) of the camera is known to ``sigma_rad``."""
    H = np.zeros((1, len(covariance)))
    H[0, ROTATION] = axis[1], -axis[0], 0.0  # how much a rotation lifts it
    return updated(covariance, H, sigma_rad)


def transitions(
    steps: FloatArray,
    interval_s: FloatArray,
    moving: BoolArray,
    drift: DriftConfig,
    correlation_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the transition matrices (n, m, m) from frame to frame, and the variances (n, m) that are added.

    A step ``s`` has the error ``scale * s + rotation x s``.

    Args:
        steps: (n, 3) of the camera, world axes, metres.
        interval_s: (n,).
        moving: (n,) whether features were followed; else nothing drifts.
        drift: How fast scale and rotation walk.
        correlation_s: (C,) after which errors of fixes count as new ones; they decay to 1/e in half of it.
    """
    F = np.tile(np.eye(PATH_ERRORS + 3 * len(correlation_s)), (len(steps), 1, 1))
    F[:, POSITION, SCALE], F[:, POSITION, ROTATION] = steps, -cross_matrices(steps)
    kept = np.repeat(np.exp(-2.0 * interval_s[:, None] / correlation_s), 3, axis=1)
    fixes = np.arange(PATH_ERRORS, F.shape[1])
    F[:, fixes, fixes] = kept
    grown = np.zeros(F.shape[:2])
    grown[:, PATH_ERRORS:] = 1.0 - kept**2
    grown[moving, SCALE] = drift.scale_sigma**2 / drift.knot_frames
    grown[moving, ROTATION] = np.radians(drift.rotation_sigma_deg) ** 2 / drift.knot_frames
    return F, grown


def fix_measurement(errors: int, arm: FloatArray, sigma_m: FloatArray, slot: int) -> FloatArray:
    """Return the measurement matrix (3, m) of the offset between antenna and fix.

    Args:
        errors: Their number m.
        arm: (3,) from camera to antenna, world axes, metres.
        sigma_m: (3,) standard deviations of the fix.
        slot: Index of its correlation time.
    """
    H = np.zeros((3, errors))
    H[:, POSITION], H[:, ROTATION] = np.eye(3), -cross_matrices(arm)
    own = PATH_ERRORS + 3 * slot
    H[:, own : own + 3] = -np.diag(sigma_m)
    return H


def updated(covariance: FloatArray, H: FloatArray, sigma: float) -> FloatArray:
    """Return the covariance after a measurement of ``H x`` (k,) with white noise ``sigma``."""
    shared = covariance @ H.T
    gain = np.linalg.solve(H @ shared + sigma**2 * np.eye(len(H)), shared.T).T
    after = covariance - gain @ shared.T
    return np.asarray((after + after.T) / 2.0)


def cross_matrices(vectors: FloatArray) -> FloatArray:
    """Return the matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    out = np.zeros((*vectors.shape[:-1], 3, 3))
    x, y, z = np.moveaxis(vectors, -1, 0)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    return np.asarray(out - np.swapaxes(out, -1, -2))

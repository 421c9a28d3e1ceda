"""The covariance of what is wrong with the newest end of a path of camera and fixes: a Kalman filter's.

Errors are the place (3) [m], the log scale, the rotation (3) [rad] about the world's axes, and what the fixes
get wrong (3 for each correlation time), in units of their standard deviations. Means are not carried: the
path is what it is, only how far it may be off is asked.
"""

import numpy as np

from vgps.config import DriftConfig
from vgps.model import BoolArray, FloatArray

PLACE, SCALE, TURN = slice(0, 3), 3, slice(4, 7)
OWN = 7  # errors of the path; those of the fixes follow
_ANYWHERE_M, _ANY_SCALE, _ANY_TURN_RAD = 100.0, 1.0, 1.0


def unknown(correlation_times: int) -> FloatArray:
    """(7 + 3 C, same) before anything was seen: anywhere, of any scale, turned by any angle."""
    sigma = np.ones(OWN + 3 * correlation_times)
    sigma[PLACE], sigma[SCALE], sigma[TURN] = _ANYWHERE_M, _ANY_SCALE, _ANY_TURN_RAD
    return np.diag(sigma**2)


def level(covariance: FloatArray, axis: FloatArray, sigma_rad: float) -> FloatArray:
    """Once an axis (3,) of the camera, given in the world, is known to rise as it does to ``sigma_rad``."""
    H = np.zeros((1, len(covariance)))
    H[0, TURN] = axis[1], -axis[0], 0.0  # how much a turn lifts it
    return seen(covariance, H, sigma_rad)


def transitions(
    steps: FloatArray,
    interval_s: FloatArray,
    moving: BoolArray,
    drift: DriftConfig,
    correlation_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """From frame to frame: ``F`` (n, m, m), and the variances (n, m) that come on top.

    A step ``s`` is wrong by ``scale * s + rotation x s``.

    Args:
        steps: (n, 3) of the camera, world axes, metres.
        interval_s: (n,).
        moving: (n,) whether features were followed: else nothing drifts.
        drift: How fast scale and rotation walk.
        correlation_s: (C,) after which errors of fixes count as new ones; they forget to 1/e in half of it.
    """
    F = np.tile(np.eye(OWN + 3 * len(correlation_s)), (len(steps), 1, 1))
    F[:, PLACE, SCALE], F[:, PLACE, TURN] = steps, -cross(steps)
    kept = np.repeat(np.exp(-2.0 * interval_s[:, None] / correlation_s), 3, axis=1)
    fixes = np.arange(OWN, F.shape[1])
    F[:, fixes, fixes] = kept
    grown = np.zeros(F.shape[:2])
    grown[:, OWN:] = 1.0 - kept**2
    grown[moving, SCALE] = drift.scale_sigma**2 / drift.knot_frames
    grown[moving, TURN] = np.radians(drift.rotation_sigma_deg) ** 2 / drift.knot_frames
    return F, grown


def fix_rows(errors: int, arm: FloatArray, sigma_m: FloatArray, slot: int) -> FloatArray:
    """(3, m) what the offset between antenna and fix is made of.

    Args:
        errors: Their number m.
        arm: (3,) from camera to antenna, world axes, metres.
        sigma_m: (3,) standard deviations of the fix.
        slot: Row of its correlation time.
    """
    H = np.zeros((3, errors))
    H[:, PLACE], H[:, TURN] = np.eye(3), -cross(arm)
    own = OWN + 3 * slot
    H[:, own : own + 3] = -np.diag(sigma_m)
    return H


def seen(covariance: FloatArray, H: FloatArray, sigma: float) -> FloatArray:
    """After a measurement of ``H x`` (k,) with white noise of standard deviation ``sigma``."""
    shared = covariance @ H.T
    gain = np.linalg.solve(H @ shared + sigma**2 * np.eye(len(H)), shared.T).T
    after = covariance - gain @ shared.T
    return np.asarray((after + after.T) / 2.0)


def cross(vectors: FloatArray) -> FloatArray:
    """(..., 3, 3) matrices of the cross product with vectors (..., 3)."""
    out = np.zeros((*vectors.shape[:-1], 3, 3))
    x, y, z = np.moveaxis(vectors, -1, 0)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    return np.asarray(out - np.swapaxes(out, -1, -2))

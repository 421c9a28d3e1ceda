"""Covariance of the errors of a path at its newest frame, by a Kalman filter.

The state has errors of position (3) [m], log scale, and rotation (3) [rad] about the world's axes, and of the
fixes (3 for each correlation time) in units of their standard deviations. Only the covariance is propagated;
the path is given.
"""

import numpy as np

from vgps.config import DriftConfig
from vgps.geometry import cross_matrices
from vgps.model import BoolArray, FloatArray

POSITION, SCALE, ROTATION = slice(0, 3), 3, slice(4, 7)
PATH_ERRORS = 7  # errors of the fixes follow
_ANYWHERE_M, _ANY_SCALE, _ANY_ROTATION_RAD = 100.0, 1.0, 1.0


def unknown_covariance(correlation_times: int) -> FloatArray:
    """Return the covariance (7 + 3 C, 7 + 3 C) of a path of unknown position, scale and rotation."""
    sigma = np.ones(PATH_ERRORS + 3 * correlation_times)
    sigma[POSITION], sigma[SCALE], sigma[ROTATION] = _ANYWHERE_M, _ANY_SCALE, _ANY_ROTATION_RAD
    return np.diag(sigma**2)


def with_level_axis(covariance: FloatArray, axis: FloatArray, sigma_rad: float) -> FloatArray:
    """Return the covariance after measuring the elevation of a camera axis (3,) with ``sigma_rad``."""
    H = np.zeros((1, len(covariance)))
    H[0, ROTATION] = axis[1], -axis[0], 0.0  # derivative of the elevation by a rotation
    return updated(covariance, H, sigma_rad)


def transitions(
    steps: FloatArray,
    interval_s: FloatArray,
    moving: BoolArray,
    drift: DriftConfig,
    correlation_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the transition matrices (n, m, m) from frame to frame, and the process noise variances (n, m).

    A step ``s`` has the error ``scale * s + rotation x s``.

    Args:
        steps: (n, 3) displacements of the camera, world axes, metres.
        interval_s: (n,) times between the frames.
        moving: (n,) whether the camera moved; during a stop nothing drifts.
        drift: Random walk of scale and rotation.
        correlation_s: (C,) times after which errors of fixes count as independent; they decay to 1/e in half
            of it.
    """
    F = np.tile(np.eye(PATH_ERRORS + 3 * len(correlation_s)), (len(steps), 1, 1))
    F[:, POSITION, SCALE], F[:, POSITION, ROTATION] = steps, -cross_matrices(steps)
    decay = np.repeat(np.exp(-2.0 * interval_s[:, None] / correlation_s), 3, axis=1)
    fixes = np.arange(PATH_ERRORS, F.shape[1])
    F[:, fixes, fixes] = decay
    noise = np.zeros(F.shape[:2])
    noise[:, PATH_ERRORS:] = 1.0 - decay**2
    noise[moving, SCALE] = drift.scale_sigma**2 / drift.knot_frames
    noise[moving, ROTATION] = np.radians(drift.rotation_sigma_deg) ** 2 / drift.knot_frames
    return F, noise


def fix_measurement(errors: int, arm: FloatArray, sigma_m: FloatArray, slot: int) -> FloatArray:
    """Return the measurement matrix (3, m) of the offset between antenna and fix.

    Args:
        errors: Number m of errors.
        arm: (3,) vector from camera to antenna, world axes, metres.
        sigma_m: (3,) standard deviations of the fix.
        slot: Index of its correlation time.
    """
    H = np.zeros((3, errors))
    H[:, POSITION], H[:, ROTATION] = np.eye(3), -cross_matrices(arm)
    first = PATH_ERRORS + 3 * slot
    H[:, first : first + 3] = -np.diag(sigma_m)
    return H


def updated(covariance: FloatArray, H: FloatArray, sigma: float) -> FloatArray:
    """Return the covariance after a measurement of ``H x`` (k,) with white noise ``sigma``."""
    shared = covariance @ H.T
    gain = np.linalg.solve(H @ shared + sigma**2 * np.eye(len(H)), shared.T).T
    after = covariance - gain @ shared.T
    return np.asarray((after + after.T) / 2.0)

"""First guess of the clock offset and of the rotation between gyro and camera."""

from typing import NamedTuple

import numpy as np

from vgps.config import GyroCalibrationConfig
from vgps.geometry.angular_rates import GyroIntegral, RelativeRotations
from vgps.model import FloatArray

_STEPS_PER_INTERVAL = 8  # of the search grid, which only needs to come close to the maximum


class Alignment(NamedTuple):
    """The rotation that best maps one set of rates to another, after subtracting their means.

    Attributes:
        gyro_R_camera: (3, 3).
        agreement: Correlation of the rates, at most 1.
        scatter: (3,) mean products of gyro and camera rates along the principal axes, (rad/s)^2, the largest
            first: how much the camera rotated about each.
    """

    gyro_R_camera: FloatArray
    agreement: float
    scatter: FloatArray


class Guess(NamedTuple):
    """Offset to add to the gyro's times, and the second-best local maximum."""

    time_offset_s: float
    alignment: Alignment
    runner_up_s: float
    runner_up: float


def align_rates(
    gyro_rates: FloatArray, camera_rates: FloatArray, weight: FloatArray | None = None
) -> Alignment:
    """Minimise ``gyro - R camera`` over rotations R, with free means (Kabsch 1976; Umeyama 1991).

    Args:
        gyro_rates, camera_rates: (P, 3) at the same times.
        weight: (P,), by default 1.
    """
    weight = np.ones(len(gyro_rates)) if weight is None else weight
    weight = weight / weight.sum()
    g = gyro_rates - weight @ gyro_rates
    c = camera_rates - weight @ camera_rates
    u, scatter, vt = np.linalg.svd((weight[:, None] * g).T @ c)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    size = np.sqrt((weight @ np.sum(g**2, axis=1)) * (weight @ np.sum(c**2, axis=1)))
    agreement = float(np.sum(scatter * sign) / max(size, 1e-300))
    return Alignment(np.asarray((u * sign) @ vt, np.float64), agreement, np.asarray(scatter, np.float64))


def guess_offset(
    rotations: RelativeRotations, camera_rates: FloatArray, gyro: GyroIntegral, config: GyroCalibrationConfig
) -> Guess | None:
    """Return the offset within ``config.search_s`` at which gyro and video agree best, for any rotation.

    Args:
        rotations: Of the camera, P intervals.
        camera_rates: (P, 3) mean rates over them.
        gyro: On its own clock.
        config: Search range and limits.

    Returns:
        The guess; None if at no offset the gyro covers ``config.min_overlap_share`` of the intervals.
    """
    size = np.linalg.norm(camera_rates, axis=1)
    limit = config.max_rate_ratio * max(float(np.median(size)), 1e-6)
    rates = camera_rates * np.minimum(1.0, limit / np.maximum(size, 1e-12))[:, None]
    step = float(np.median(rotations.end_s - rotations.start_s)) / _STEPS_PER_INTERVAL
    count = int(np.ceil(config.search_s / step))
    least = max(3.0, config.min_overlap_share * len(rotations))
    offsets = step * np.arange(-count, count + 1)
    found = [_aligned_at(rotations, rates, gyro, offset, least) for offset in offsets]
    agreement = np.array([-1.0 if one is None else one.agreement for one in found])
    best = int(agreement.argmax())
    alignment = found[best]
    if alignment is None:
        return None
    peak = np.r_[False, (agreement[1:-1] > agreement[:-2]) & (agreement[1:-1] >= agreement[2:]), False]
    peak[best] = False
    other = int(np.where(peak, agreement, -1.0).argmax())
    return Guess(float(offsets[best]), alignment, float(offsets[other]), float(agreement[other]))


def _aligned_at(
    rotations: RelativeRotations, rates: FloatArray, gyro: GyroIntegral, offset_s: float, least: float
) -> Alignment | None:
    start, end = rotations.start_s - offset_s, rotations.end_s - offset_s
    covered = gyro.covers(start, end)
    if covered.sum() < least:
        return None
    return align_rates(gyro.mean_rates(start[covered], end[covered]), rates[covered])

"""Poses of frames in which no landmark was found, between those in which some were."""

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from vgps.localization.prediction import MotionState, RotationPredictor
from vgps.model import BoolArray, FloatArray


def bridge_gaps(
    t_s: FloatArray,
    world_T_camera: FloatArray,
    tracked: BoolArray,
    rotations: RotationPredictor,
    gyro_bias_rad_s: FloatArray,
    coast_s: float,
) -> FloatArray:
    """Fill the frames that are not tracked.

    Within a gap the rotation follows the gyro, and what it misses at the far end is spread over the gap;
    without a gyro it turns evenly. The centre follows a smooth curve through the tracked frames. Before the
    first and after the last tracked frame the velocity lasts for ``coast_s``, then the camera stands.

    Args:
        t_s: (F,) times.
        world_T_camera: (F, 4, 4); only tracked ones are looked at.
        tracked: (F,) at least one.
        rotations: The gyro.
        gyro_bias_rad_s: (3,).
        coast_s: See above.

    Returns:
        (F, 4, 4), tracked frames unchanged.
    """
    out = world_T_camera.copy()
    good, missing = np.flatnonzero(tracked), np.flatnonzero(~tracked)
    if len(missing) == 0:
        return out
    out[missing] = np.eye(4)
    out[missing, :3, 3] = _centres(t_s[good], world_T_camera[good, :3, 3], t_s[missing], coast_s)
    for i in missing:
        after = int(np.searchsorted(good, i))
        before = good[after - 1] if after > 0 else None
        following = good[after] if after < len(good) else None
        out[i, :3, :3] = _rotation(t_s, world_T_camera, before, int(i), following, rotations, gyro_bias_rad_s)
    return out


def _centres(t_s: FloatArray, centres: FloatArray, at_s: FloatArray, coast_s: float) -> FloatArray:
    if len(t_s) == 1:
        return np.repeat(centres, len(at_s), axis=0)
    inside = np.asarray(PchipInterpolator(t_s, centres)(np.clip(at_s, t_s[0], t_s[-1])))
    first, last = (centres[k + 1] - centres[k] for k in (0, -2))
    early = np.clip(at_s - t_s[0], -coast_s, 0)[:, None] * first / (t_s[1] - t_s[0])
    late = np.clip(at_s - t_s[-1], 0, coast_s)[:, None] * last / (t_s[-1] - t_s[-2])
    return np.asarray(inside + early + late)


def _rotation(
    t_s: FloatArray,
    poses: FloatArray,
    before: int | None,
    at: int,
    after: int | None,
    rotations: RotationPredictor,
    bias: FloatArray,
) -> FloatArray:
    """World rotation (3, 3) of frame ``at`` from the tracked frames next to it."""
    if before is None or after is None:
        near = before if before is not None else after
        assert near is not None
        motion = MotionState(t_s[near], poses[near], None, np.zeros(3), bias)
        return np.asarray(poses[near, :3, :3] @ rotations.relative_rotation(motion, t_s[near], t_s[at]))
    # without a gyro over the whole gap all of the turn is spread evenly
    motion = MotionState(t_s[before], poses[before], None, np.zeros(3), bias)
    whole = rotations.relative_rotation(motion, t_s[before], t_s[after])
    missed = Rotation.from_matrix((poses[before, :3, :3] @ whole).T @ poses[after, :3, :3]).as_rotvec()
    known = rotations.covers(t_s[before], t_s[after])
    part = rotations.relative_rotation(motion, t_s[before], t_s[at]) if known else np.eye(3)
    rest = part.T @ whole  # the missed turn is said in the axes of the frame after
    share = (t_s[at] - t_s[before]) / (t_s[after] - t_s[before])
    spread = Rotation.from_rotvec(share * (rest @ missed)).as_matrix()
    return np.asarray(poses[before, :3, :3] @ part @ spread)

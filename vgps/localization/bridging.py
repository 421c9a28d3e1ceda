"""Poses of frames that could not be tracked, from the tracked frames around them."""

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
    """Fill in the poses of frames that are not tracked.

    Within a gap the rotation follows the gyro, its error at the far end spread over the gap; without a gyro
    the rotation is even. The centre follows a smooth curve through the tracked frames. Before the first and
    after the last tracked frame the velocity continues for ``coast_s``, then the camera stands still.

    Args:
        t_s: (F,) times.
        world_T_camera: (F, 4, 4); only those of tracked frames are used.
        tracked: (F,) at least one.
        rotations: The gyro.
        gyro_bias_rad_s: (3,).
        coast_s: How long the velocity continues at either end.

    Returns:
        (F, 4, 4), tracked frames unchanged.
    """
    out = world_T_camera.copy()
    good, missing = np.flatnonzero(tracked), np.flatnonzero(~tracked)
    if len(missing) == 0:
        return out
    out[missing] = np.eye(4)
    out[missing, :3, 3] = _centres(t_s[good], world_T_camera[good, :3, 3], t_s[missing], coast_s)
    states = [
        MotionState(t_s=t_s[i], world_T_camera=world_T_camera[i], gyro_bias_rad_s=gyro_bias_rad_s)
        for i in good
    ]
    for i in missing:
        after = int(np.searchsorted(good, i))
        if 0 < after < len(good):
            out[i, :3, :3] = _rotation_between(states[after - 1], t_s[i], states[after], rotations)
        else:
            out[i, :3, :3] = _rotation_beyond(states[min(after, len(good) - 1)], t_s[i], rotations)
    return out


def _centres(t_s: FloatArray, centres: FloatArray, at_s: FloatArray, coast_s: float) -> FloatArray:
    if len(t_s) == 1:
        return np.repeat(centres, len(at_s), axis=0)
    inside = np.asarray(PchipInterpolator(t_s, centres)(np.clip(at_s, t_s[0], t_s[-1])))
    first, last = (centres[k + 1] - centres[k] for k in (0, -2))
    early = np.clip(at_s - t_s[0], -coast_s, 0)[:, None] * first / (t_s[1] - t_s[0])
    late = np.clip(at_s - t_s[-1], 0, coast_s)[:, None] * last / (t_s[-1] - t_s[-2])
    return np.asarray(inside + early + late)


def _rotation_beyond(nearest: MotionState, t_s: float, rotations: RotationPredictor) -> FloatArray:
    """Return the world rotation (3, 3) at a time before the first or after the last tracked frame."""
    rotation = rotations.relative_rotation(nearest, nearest.t_s, t_s)
    return np.asarray(nearest.world_T_camera[:3, :3] @ rotation)


def _rotation_between(
    before: MotionState, t_s: float, after: MotionState, rotations: RotationPredictor
) -> FloatArray:
    """Return the world rotation (3, 3) at a time between two tracked frames."""
    start, end = before.world_T_camera[:3, :3], after.world_T_camera[:3, :3]
    whole = rotations.relative_rotation(before, before.t_s, after.t_s)
    error = Rotation.from_matrix((start @ whole).T @ end).as_rotvec()
    # without a gyro over the whole gap all of the rotation is spread evenly
    covered = rotations.covers(before.t_s, after.t_s)
    part = rotations.relative_rotation(before, before.t_s, t_s) if covered else np.eye(3)
    rest = part.T @ whole  # takes the error from the axes of the frame after to those at t_s
    share = (t_s - before.t_s) / (after.t_s - before.t_s)
    correction = Rotation.from_rotvec(share * (rest @ error)).as_matrix()
    return np.asarray(start @ part @ correction)

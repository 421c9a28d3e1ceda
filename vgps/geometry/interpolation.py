"""Poses at times between frames: linear in position, slerp in rotation."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vgps.model import FloatArray


def interpolate_poses(t_s: FloatArray, poses: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return poses (M, 4, 4) at (M,) from poses (N, 4, 4) at ``t_s`` (N,); times outside are clamped."""
    at_s = np.clip(at_s, t_s[0], t_s[-1])
    out = np.tile(np.eye(4), (len(at_s), 1, 1))
    if len(at_s) == 0:
        return out
    for axis in range(3):
        out[:, axis, 3] = np.interp(at_s, t_s, poses[:, axis, 3])
    out[:, :3, :3] = Slerp(t_s, Rotation.from_matrix(poses[:, :3, :3]))(at_s).as_matrix()
    return out

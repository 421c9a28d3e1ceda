"""Vectors and poses at times between samples: linear in position, slerp in rotation."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vgps.model import FloatArray


def interpolate_vectors(t_s: FloatArray, vectors: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return vectors (M, k) at (M,) from vectors (N, k) at ``t_s`` (N,); times outside are clamped."""
    return np.stack([np.interp(at_s, t_s, column) for column in vectors.T], axis=1)


def interpolate_poses(t_s: FloatArray, poses: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return poses (M, 4, 4) at (M,) from poses (N, 4, 4) at ``t_s`` (N,); times outside are clamped."""
    at_s = np.clip(at_s, t_s[0], t_s[-1])
    out = np.tile(np.eye(4), (len(at_s), 1, 1))
    if len(at_s) == 0:
        return out
    out[:, :3, 3] = interpolate_vectors(t_s, poses[:, :3, 3], at_s)
    out[:, :3, :3] = Slerp(t_s, Rotation.from_matrix(poses[:, :3, :3]))(at_s).as_matrix()
    return out

"""Rotation matrices of rotation vectors and back, in a fraction of SciPy's time for a handful of them."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry.cross_product import cross_matrices
from vgps.model import FloatArray

_LARGE = -0.5  # cosine; towards 180 degrees the antisymmetric part loses the axis
_SMALL = 1e-12  # sine, which is the angle


def rotation_matrices(vectors: FloatArray) -> FloatArray:
    """Return the rotations (N, 3, 3) by vectors (N, 3), axis times angle, with Rodrigues' formula."""
    turns = np.linalg.norm(vectors, axis=1)[:, None, None] / np.pi
    K = cross_matrices(vectors)
    return np.asarray(np.eye(3) + np.sinc(turns) * K + 0.5 * np.sinc(0.5 * turns) ** 2 * K @ K)


def rotation_vectors(R: FloatArray) -> FloatArray:
    """Return axis times angle (N, 3), at most pi, of rotations (N, 3, 3)."""
    cosine = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    if (cosine < _LARGE).any():
        return np.asarray(Rotation.from_matrix(R).as_rotvec())
    antisymmetric = 0.5 * (R - R.transpose(0, 2, 1))
    axis = np.stack([antisymmetric[:, k, j] for j, k in ((1, 2), (2, 0), (0, 1))], axis=1)  # times the sine
    sine = np.linalg.norm(axis, axis=1)
    turning = sine > _SMALL
    angle_per_sine = np.where(turning, np.arctan2(sine, cosine) / np.where(turning, sine, 1.0), 1.0)
    return np.asarray(angle_per_sine[:, None] * axis)

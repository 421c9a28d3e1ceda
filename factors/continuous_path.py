"""A continuous path through the poses of frames: cubic polynomials of position and quaternion.

Between two frames the path is Lagrange's cubic polynomial through the four nearest frames, at the ends of the
video through the first or the last four. Position and quaternion are one vector
``x = [w, x, y, z, position]``, and the pose at a time is ``sum_k w_k(t) x_k`` with its quaternion
normalised. So the path passes through every frame, is continuous, and its derivative by a frame's pose is a
weight times a matrix of that frame.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

MAX_KNOTS = 4
VECTOR_DIM = 7


def knots_around(t_s: FloatArray, interval: IntArray) -> IntArray:
    """Return the frames (N, k) that give the path in intervals between frames; k is 4, or F if less.

    Args:
        t_s: (F,) times of the frames.
        interval: (N,) the frame before each interval; numbers outside count as the first or last interval.
    """
    count = min(MAX_KNOTS, len(t_s))
    first = np.clip(interval - 1, 0, len(t_s) - count)
    return np.asarray(first[:, None] + np.arange(count))


def path_weights(knot_s: FloatArray, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the weights (N, k) of the knots at times (N,), and their derivatives by the time, 1/s.

    Args:
        knot_s: (N, k) times of the knots.
        at_s: (N,) times.
    """
    count = knot_s.shape[1]
    weights, rates = np.ones_like(knot_s), np.zeros_like(knot_s)
    for k in range(count):
        for m in range(count):
            if m != k:
                slope = 1.0 / (knot_s[:, k] - knot_s[:, m])
                factor = slope * (at_s - knot_s[:, m])
                rates[:, k] = rates[:, k] * factor + weights[:, k] * slope
                weights[:, k] *= factor
    return weights, rates


def path_vectors(world_T_camera: FloatArray) -> FloatArray:
    """Return the vectors (F, 7) of poses (F, 4, 4) in order of time, quaternions without changes of sign."""
    vectors = np.empty((len(world_T_camera), VECTOR_DIM))
    vectors[:, :4] = _quaternions(world_T_camera[:, :3, :3])
    vectors[:, 4:] = world_T_camera[:, :3, 3]
    turned = np.sum(vectors[1:, :4] * vectors[:-1, :4], axis=1) < 0.0
    vectors[1:, :4] *= np.cumprod(np.where(turned, -1.0, 1.0))[:, None]
    return vectors


def path_poses(vectors: FloatArray) -> FloatArray:
    """Return the poses (N, 4, 4) of weighted sums of vectors (N, 7)."""
    quaternions = np.ascontiguousarray(vectors[:, :4].T)
    w, x, y, z = quaternions * np.sqrt(2.0 / np.einsum("in,in->n", quaternions, quaternions))
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    poses = np.zeros((len(vectors), 4, 4))
    poses[:, 0, 0], poses[:, 0, 1], poses[:, 0, 2] = 1.0 - yy - zz, xy - wz, xz + wy
    poses[:, 1, 0], poses[:, 1, 1], poses[:, 1, 2] = xy + wz, 1.0 - xx - zz, yz - wx
    poses[:, 2, 0], poses[:, 2, 1], poses[:, 2, 2] = xz - wy, yz + wx, 1.0 - xx - yy
    poses[:, :3, 3], poses[:, 3, 3] = vectors[:, 4:], 1.0
    return poses


def poses_at(
    t_s: FloatArray, world_T_camera: FloatArray, at_s: FloatArray, interval: IntArray | None = None
) -> FloatArray:
    """Return the poses (N, 4, 4) of the path at times (N,); beyond the ends the polynomials go on.

    Args:
        t_s: (F,) times of the frames.
        world_T_camera: (F, 4, 4).
        at_s: (N,) times.
        interval: (N,) the frame before the interval whose polynomial is used; None for that of the time.
    """
    if interval is None:
        interval = np.searchsorted(t_s, at_s, side="right").astype(np.int64) - 1
    knots = knots_around(t_s, interval)
    weights, _ = path_weights(t_s[knots], at_s)
    return path_poses(np.einsum("nk,nkd->nd", weights, path_vectors(world_T_camera)[knots]))


def vector_jacobians(vectors: FloatArray) -> FloatArray:
    """Return the derivatives (F, 7, 6) of vectors by their poses' tangents [rotation; translation]."""
    jacobians = np.zeros((len(vectors), VECTOR_DIM, 6))
    w, x, y, z = 0.5 * vectors[:, :4].T
    jacobians[:, 0, :3] = np.stack([-x, -y, -z], axis=1)
    jacobians[:, 1, :3] = np.stack([w, -z, y], axis=1)
    jacobians[:, 2, :3] = np.stack([z, w, -x], axis=1)
    jacobians[:, 3, :3] = np.stack([-y, x, w], axis=1)
    jacobians[:, 4:, 3:] = path_poses(vectors)[:, :3, :3]
    return jacobians


def rotation_jacobians(quaternions: FloatArray) -> FloatArray:
    """Return the derivatives (N, 3, 4) of a rotation's tangent by its quaternion (N, 4) of any length."""
    square = np.sum(quaternions**2, axis=1)
    w, x, y, z = 2.0 * quaternions.T / square
    rows = [[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]
    return np.stack([np.stack(row, axis=1) for row in rows], axis=1)


def _quaternions(rotations: FloatArray) -> FloatArray:
    """Return unit quaternions (N, 4) w, x, y, z of rotations (N, 3, 3)."""
    R = rotations.transpose(1, 2, 0)
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    square = np.empty((len(rotations), 4, 4))  # four times the outer product of the quaternion with itself
    square[:, 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        square[:, 1 + i, 1 + i] = 1.0 + 2.0 * R[i, i] - trace
        square[:, 0, 1 + i] = square[:, 1 + i, 0] = R[k, j] - R[j, k]
        square[:, 1 + i, 1 + j] = square[:, 1 + j, 1 + i] = R[i, j] + R[j, i]
    largest = np.argmax(np.diagonal(square, axis1=1, axis2=2), axis=1)
    rows = square[np.arange(len(square)), largest]
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))

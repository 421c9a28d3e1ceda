"""Loops in stage D: which of them fit, and how they hold the path against a drift of the video."""

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from vgps.geometry import cross_matrices
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solver.cost import camera_points, pixel_errors, robust_weight
from vgps.solver.elimination import SparsityStructure
from vgps.solver.problem import BundleProblem

_PART = 12000  # observations whose products with all draws are in memory at once
_DAMPING = 1e-9  # relative: the depth of a landmark that is seen along one ray


def fitting_loops(good: BoolArray, in_front: BoolArray, loop: IntArray, rough: bool) -> BoolArray:
    """Return the observations (N,) to use: a loop is refused as a whole if less than half of it fits.

    Args:
        good: (N,) whether an observation agrees with the scene.
        in_front: (N,) whether its landmark lies in front of the camera.
        loop: (N,) number of its loop, -1 for observations of a track.
        rough: Whether the poses have not been optimised with the loops yet: then all of them are used.
    """
    number = np.maximum(loop, 0)
    if rough:
        return np.where(loop < 0, good, in_front)
    all_ = np.bincount(number[loop >= 0], minlength=number.max(initial=0) + 1)
    fitting = np.bincount(number[(loop >= 0) & good], minlength=len(all_))
    return np.asarray(good & ((loop < 0) | (2 * fitting >= all_)[number]))


def loop_gradient(
    problem: BundleProblem, loop: IntArray, structure: SparsityStructure, drift: FloatArray
) -> FloatArray:
    """Return the gradients (6 n_free, K) of the loops' observations under deformations (6 n_free, K).

    A deformation d moves the landmarks so that tracks keep their residuals, ``d_l = -V^-1 J_l^T J_p d`` over
    their observations; those of loops change by ``r = J_p d + J_l d_l``. Their gradient is reduced to the
    poses as every other, by the landmarks' equations over all observations.

    Args:
        problem: At its optimum.
        loop: (N,) number of the loop of each observation, -1 for those of tracks.
        structure: Columns of the poses.
        drift: The deformations.
    """
    total = np.zeros_like(drift)
    for rows in _by_landmark(problem, loop):
        part, again = problem.select_observations(rows), loop[rows] >= 0
        by_pose, by_point, blocks = _jacobians(part, structure)
        follow = -(_inverse(blocks, part, ~again) @ (_kept(by_point, ~again).T @ (by_pose @ drift)))
        r = _kept(by_pose, again) @ drift + _kept(by_point, again) @ follow
        absorbed = by_point @ (_inverse(blocks, part, again | ~again) @ (by_point.T @ r))
        total += by_pose.T @ (r - absorbed)
    return total


def _by_landmark(problem: BundleProblem, loop: IntArray) -> Iterator[IntArray]:
    """Yield the observations of landmarks that loops observe, some whole landmarks at a time."""
    rows = np.flatnonzero(np.isin(problem.landmark, problem.landmark[loop >= 0]))
    rows = rows[np.argsort(problem.landmark[rows], kind="stable")]
    begins = np.flatnonzero(np.diff(problem.landmark[rows], prepend=-1))
    cuts = begins[np.flatnonzero(np.diff(begins // _PART, prepend=0))]
    yield from np.split(rows, cuts)


def _jacobians(
    part: BundleProblem, structure: SparsityStructure
) -> tuple[sparse.csr_array, sparse.csr_array, FloatArray]:
    """Return the whitened Jacobians to the poses (2 n, 6 n_free) and to the landmarks (2 n, 3 m), and (n, 3,
    3) the products of the latter."""
    fx, fy, _, _ = part.K
    camera_p = camera_points(part)
    error, _ = pixel_errors(part, camera_p)
    x, y, z = camera_p
    zero = np.zeros_like(z)
    by_camera = np.stack(
        [np.stack([fx / z, zero, -fx * x / z**2], 1), np.stack([zero, fy / z, -fy * y / z**2], 1)], 1
    )
    weight = robust_weight(part, np.sum(error**2, axis=0) / part.sigma_px**2)
    by_camera *= (np.sqrt(weight) / part.sigma_px)[:, None, None]
    eye = np.tile(np.eye(3), (len(z), 1, 1))
    pose = by_camera @ np.concatenate([cross_matrices(camera_p.T), -eye], axis=2)
    point = by_camera @ part.world_T_camera[part.frame, :3, :3].swapaxes(1, 2)
    _, landmark = np.unique(part.landmark, return_inverse=True)
    return (
        _sparse(pose, structure.free[part.frame], structure.n_free),
        _sparse(point, landmark, int(landmark.max()) + 1),
        point.swapaxes(1, 2) @ point,
    )


def _sparse(blocks: FloatArray, place: IntArray, places: int) -> sparse.csr_array:
    """Return blocks (n, 2, w) as a matrix (2 n, w places), without those whose place is -1."""
    n, _, width = blocks.shape
    kept = np.flatnonzero(place >= 0)
    row = np.broadcast_to(2 * kept[:, None, None] + np.arange(2)[:, None], (len(kept), 2, width))
    column = np.broadcast_to(width * place[kept, None, None] + np.arange(width), (len(kept), 2, width))
    entries = (blocks[kept].ravel(), (row.ravel(), column.ravel()))
    return sparse.csr_array(entries, shape=(2 * n, width * places))


def _kept(matrix: sparse.csr_array, rows: BoolArray) -> sparse.csr_array:
    """Return a matrix (2 n, k) whose rows of other observations (n,) are zero."""
    return sparse.csr_array(sparse.diags_array(np.repeat(rows.astype(float), 2)) @ matrix)


def _inverse(blocks: FloatArray, part: BundleProblem, rows: BoolArray) -> sparse.csr_array:
    """Return the inverse (3 m, 3 m) of the landmarks' normal equations over some observations (n,)."""
    _, landmark = np.unique(part.landmark, return_inverse=True)
    V = np.zeros((int(landmark.max()) + 1, 3, 3))
    np.add.at(V, landmark[rows], blocks[rows])
    V += _DAMPING * np.trace(V, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return sparse.csr_array(sparse.block_diag(list(np.linalg.inv(V)), format="csr"))

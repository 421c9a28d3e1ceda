"""Loops in stage D: which of them fit, and how they hold the path against a drift of the video."""

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solver.cost import camera_points, pixel_errors, view_poses
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.equations.normal_equations import projection_jacobians, whitening
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
        landmarks, landmark = np.unique(part.landmark, return_inverse=True)
        pose, point = _jacobians(part)
        by_pose = _sparse(pose, structure.free[part.frame], structure.n_free)
        by_point = _sparse(point, landmark, len(landmarks))
        blocks = point.swapaxes(1, 2) @ point
        tracks: FloatArray = np.zeros((len(landmarks), 3, 3))
        np.add.at(tracks, landmark[~again], blocks[~again])
        whole = tracks.copy()
        np.add.at(whole, landmark[again], blocks[again])
        follow = -(_inverse(tracks) @ (_kept(by_point, ~again).T @ (by_pose @ drift)))
        r = _kept(by_pose, again) @ drift + _kept(by_point, again) @ follow
        total += by_pose.T @ (r - by_point @ (_inverse(whole) @ (by_point.T @ r)))
    return total


def _by_landmark(problem: BundleProblem, loop: IntArray) -> Iterator[IntArray]:
    """Yield the observations of landmarks that loops observe, some whole landmarks at a time."""
    rows = np.flatnonzero(np.isin(problem.landmark, problem.landmark[loop >= 0]))
    if not len(rows):  # all loops have been refused
        return
    rows = rows[np.argsort(problem.landmark[rows], kind="stable")]
    begins = np.flatnonzero(np.diff(problem.landmark[rows], prepend=-1))
    cuts = begins[np.flatnonzero(np.diff(begins // _PART, prepend=0))]
    yield from np.split(rows, cuts)


def _jacobians(part: BundleProblem) -> tuple[FloatArray, FloatArray]:
    """Return the whitened Jacobians of observations to poses (n, 2, 6) and to landmarks (n, 2, 3)."""
    views = view_poses(part)
    camera_p = camera_points(part, views)
    error, behind = pixel_errors(part, camera_p)
    scale = np.where(behind, 0.0, whitening(part, error))
    pose, point = projection_jacobians(part, camera_p, scale, views)
    return pose.transpose(2, 0, 1), point.transpose(2, 0, 1)


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


def _inverse(blocks: FloatArray) -> sparse.csr_array:
    """Return the inverse (3 m, 3 m) of the landmarks' normal equations, blocks (m, 3, 3)."""
    damping = _DAMPING * np.trace(blocks, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return sparse.csr_array(sparse.block_diag(list(np.linalg.inv(blocks + damping)), format="csr"))

"""Normal equations of a bundle problem, with the landmarks eliminated: many observations at once, in arrays.

Poses move in GTSAM's tangent, ``world_T_camera * Expmap([rotation; translation])``, so the pose factors'
linearisation by GTSAM itself adds up with the observations'. Arrays over observations have the observation
last: the arithmetic then runs along contiguous memory.
"""

from dataclasses import dataclass

import gtsam
import numpy as np
from scipy import sparse

from vgps.model import FloatArray
from vgps.solver.band_matrix import POSE
from vgps.solver.elimination import Chunk, Matrix, Structure
from vgps.solver.pose_equations import MIN_DIAGONAL, Border, pose_graph_normal
from vgps.solver.problem import BundleProblem, camera_points, residuals, robust_weight

_PIVOT = 1e-14  # relative to the diagonal: what rounding leaves of a point seen along one ray
_ROWS = ((0, 1), (0, 1), (0, 1), (0,), (1,), (0, 1))  # u, v: which of them a pose coordinate moves
_LOWER = tuple((a, b) for a in range(POSE) for b in range(a + 1))


def _dot(p: FloatArray, q: FloatArray, rows: tuple[int, ...] = (0, 1)) -> FloatArray:
    """(n,) products of two arrays' rows, summed over those rows that are not zero."""
    total: FloatArray = p[rows[0]] * q[rows[0]]
    for row in rows[1:]:
        total += p[row] * q[row]
    return total


@dataclass(frozen=True)
class LinearChunk:
    """Whitened, reweighted Jacobians of a chunk's observations, and its landmarks' normal equations.

    Attributes:
        chunk: The observations.
        jp, jl, r: (2, 6, n) by the pose, (2, 3, n) by the landmark, (2, n) residuals.
        hessian: (6, m) lower triangles of the landmarks' blocks, row by row.
        gradient: (3, m).
    """

    chunk: Chunk
    jp: FloatArray
    jl: FloatArray
    r: FloatArray
    hessian: FloatArray
    gradient: FloatArray

    @property
    def diagonal(self) -> FloatArray:
        """(3, m) diagonals that damping scales with."""
        return np.maximum(self.hessian[[0, 2, 5]], MIN_DIAGONAL)

    def pose_gradient(self, r: FloatArray) -> FloatArray:
        """(6, frames of the chunk) sums of J^T r by the poses, for any (2, n) r."""
        at, frames = self.chunk.frame, self.chunk.frames
        return np.array([np.bincount(at, _dot(self.jp[:, a], r, _ROWS[a]), frames) for a in range(POSE)])

    def landmark_gradient(self, r: FloatArray) -> FloatArray:
        """(3, m) sums of J^T r by the landmarks, for any (2, n) r."""
        at, size = self.chunk.landmark, len(self.chunk.landmarks)
        return np.array([np.bincount(at, _dot(self.jl[:, k], r), size) for k in range(3)])


@dataclass(frozen=True)
class Linearization:
    """The chunks' linearisations, and the free poses' own normal equations.

    Attributes:
        chunks: Of the observations.
        hessian: Lower triangle of the poses' part, (6 n_free, 6 n_free).
        gradient: (6 n_free,).
        landmarks: L, of the problem.
        border: Of what all frames share.
    """

    chunks: tuple[LinearChunk, ...]
    hessian: sparse.coo_array
    gradient: FloatArray
    landmarks: int
    border: Border

    @property
    def diagonal(self) -> FloatArray:
        """(6 n_free,) diagonal that damping scales with."""
        diagonal: FloatArray = np.maximum(self.hessian.diagonal(), MIN_DIAGONAL)
        return diagonal


def linearize(problem: BundleProblem, values: gtsam.Values, structure: Structure) -> Linearization:
    """Jacobians of all observations and pose factors.

    Args:
        problem: Where to.
        values: Its poses, for the pose factors.
        structure: Of the problem.
    """
    chunks = []
    blocks = np.zeros((len(_LOWER), len(structure.free)))
    gradient = np.zeros((POSE, len(structure.free)))
    for chunk in structure.chunks:
        linear = linearize_chunk(problem, chunk)
        frames = slice(chunk.first_frame, chunk.first_frame + chunk.frames)
        blocks[:, frames] += _pose_blocks(linear)
        gradient[:, frames] += linear.pose_gradient(linear.r)
        chunks.append(linear)
    moves = structure.free >= 0
    hessian, own_gradient, border = pose_graph_normal(problem, values, structure)
    total = (hessian + _block_diagonal(blocks[:, moves])).tocoo()
    total_gradient = gradient[:, moves].T.ravel() + own_gradient
    return Linearization(tuple(chunks), total, total_gradient, len(problem.world_p_landmark), border)


def linearize_chunk(problem: BundleProblem, chunk: Chunk) -> LinearChunk:
    """Jacobians of a chunk's observations where the problem's poses and points are."""
    here = chunk.problem.moved(problem.world_T_camera, problem.world_p_landmark)
    camera_p = camera_points(here)
    error, behind = residuals(here, camera_p)
    scale = whitening(here, error)
    jp, jl = _jacobians(here, camera_p, np.where(behind, 0.0, scale))
    r = error * scale
    size = len(chunk.landmarks)
    at = chunk.landmark
    hessian = [np.bincount(at, _dot(jl[:, a], jl[:, b]), size) for a in range(3) for b in range(a + 1)]
    gradient = [np.bincount(at, _dot(jl[:, a], r), size) for a in range(3)]
    return LinearChunk(chunk, jp, jl, r, np.array(hessian), np.array(gradient))


def whitening(problem: BundleProblem, error: FloatArray) -> FloatArray:
    """(n,) factors of residuals with pixel errors (2, n): the root of the robust weight over the sigma."""
    weight = robust_weight(problem, np.sum(error**2, axis=0) / problem.sigma_px**2)
    return np.asarray(np.sqrt(weight) / problem.sigma_px)


def _jacobians(
    problem: BundleProblem, camera_p: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Scaled Jacobians of the projection; behind the camera, where ``scale`` is zero, they are zero.

    A point p of the camera frame moves by ``[p]_x rotation - translation + R^T d(point)``.
    """
    fx, fy, _, _ = problem.K
    depth = np.where(camera_p[2] > 0.0, camera_p[2], 1.0)
    x, y = camera_p[0] / depth, camera_p[1] / depth
    su, sv = fx * scale, fy * scale
    du, dv = su / depth, sv / depth
    jp = np.zeros((2, POSE, len(scale)))
    jp[0, 0], jp[0, 1], jp[0, 2] = su * x * y, -su * (1.0 + x * x), su * y
    jp[1, 0], jp[1, 1], jp[1, 2] = sv * (1.0 + y * y), -sv * x * y, -sv * x
    jp[0, 3], jp[0, 5] = -du, du * x
    jp[1, 4], jp[1, 5] = -dv, dv * y
    jl = np.empty((2, 3, len(scale)))
    for axis in range(3):
        R = [problem.world_T_camera[:, axis, column][problem.frame] for column in range(3)]
        jl[0, axis] = du * (R[0] - x * R[2])
        jl[1, axis] = dv * (R[1] - y * R[2])
    return jp, jl


def _pose_blocks(linear: LinearChunk) -> FloatArray:
    """(21, frames of the chunk) lower triangles of the poses' blocks, row by row."""
    jp, frame, frames = linear.jp, linear.chunk.frame, linear.chunk.frames
    blocks = np.zeros((len(_LOWER), frames))
    for row, (a, b) in enumerate(_LOWER):
        rows = tuple(i for i in _ROWS[a] if i in _ROWS[b])
        if rows:
            blocks[row] = np.bincount(frame, _dot(jp[:, a], jp[:, b], rows), frames)
    return blocks


def _block_diagonal(blocks: FloatArray) -> sparse.csr_array:
    n = blocks.shape[1]
    rows, columns = np.array(_LOWER).T
    at = POSE * np.arange(n)
    index = ((at + rows[:, None]).ravel(), (at + columns[:, None]).ravel())
    return sparse.csr_array((blocks.ravel(), index), shape=(POSE * n, POSE * n))


@dataclass(frozen=True)
class PointFactors:
    """Inverse Cholesky factors M of landmarks' (3, 3) blocks, M^T M = V^-1: ``m`` (6, m) row by row."""

    m: FloatArray

    def times(self, v: FloatArray) -> FloatArray:
        """M v for (3, m) v."""
        m = self.m
        return np.stack([m[0] * v[0], m[1] * v[0] + m[2] * v[1], m[3] * v[0] + m[4] * v[1] + m[5] * v[2]])

    def transposed_times(self, v: FloatArray) -> FloatArray:
        """M^T v for (3, m) v."""
        m = self.m
        return np.stack([m[0] * v[0] + m[1] * v[1] + m[3] * v[2], m[2] * v[1] + m[4] * v[2], m[5] * v[2]])


def factor_points(linear: LinearChunk, damping: FloatArray | float) -> PointFactors:
    """Factors of the landmarks' blocks with ``damping``, or (m,), times their diagonal added.

    A point seen once, or along nearly one ray, has a singular block: the damping, or failing that a pivot
    held above rounding, lets it keep its depth.
    """
    a, b, c, d, e, f = linear.hessian
    more = damping * linear.diagonal
    a, c, f = a + more[0], c + more[1], f + more[2]
    l11 = np.sqrt(np.maximum(a, 1e-300))
    l21, l31 = b / l11, d / l11
    l22 = np.sqrt(np.maximum(c - l21 * l21, _PIVOT * c + 1e-300))
    l32 = (e - l21 * l31) / l22
    l33 = np.sqrt(np.maximum(f - l31 * l31 - l32 * l32, _PIVOT * f + 1e-300))
    m11, m22, m33 = 1.0 / l11, 1.0 / l22, 1.0 / l33
    m21, m32 = -m22 * l21 * m11, -m33 * l32 * m22
    m31 = -m33 * (l31 * m11 + l32 * m21)
    return PointFactors(np.stack([m11, m21, m22, m31, m32, m33]))


def reduce_to_poses(linear: Linearization, structure: Structure, damping: float) -> tuple[Matrix, FloatArray]:
    """Schur complement on the free poses with ``damping`` times its own diagonal added, and its gradient."""
    band = structure.empty()
    hessian = linear.hessian
    band.add_entries(hessian.row.astype(np.int64), hessian.col.astype(np.int64), hessian.data)
    band.add_diagonal(damping * linear.diagonal)
    explained = np.zeros((POSE, len(structure.free)))
    scratch = np.empty(max((chunk.size for chunk in structure.chunks), default=0))
    for part in linear.chunks:
        chunk = part.chunk
        coupling, r = _coupling(part, factor_points(part, damping))
        explained[:, chunk.first_frame : chunk.first_frame + chunk.frames] += part.pose_gradient(r)
        buffer = scratch[: chunk.size]
        _fill(part, coupling, buffer)
        for group in chunk.groups:
            group.subtract_square(buffer, band)
    return band, linear.gradient - explained[:, structure.free >= 0].T.ravel()


def _coupling(linear: LinearChunk, points: PointFactors) -> tuple[FloatArray, FloatArray]:
    """(2, 3, n) B = J_l M^T per observation, and the residuals (2, n) that moving the points explains."""
    at, jl = linear.chunk.landmark, linear.jl
    m = points.m[:, at]
    y = points.times(linear.gradient)[:, at]
    B = np.empty_like(jl)
    for i in range(2):
        B[i, 0] = jl[i, 0] * m[0]
        B[i, 1] = jl[i, 0] * m[1] + jl[i, 1] * m[2]
        B[i, 2] = jl[i, 0] * m[3] + jl[i, 1] * m[4] + jl[i, 2] * m[5]
    return B, B[:, 0] * y[0] + B[:, 1] * y[1] + B[:, 2] * y[2]


def pose_scores(linear: LinearChunk) -> FloatArray:
    """(6, n) what each observation adds to the reduced gradient, the landmarks at their best."""
    _, explained = _coupling(linear, factor_points(linear, 0.0))
    r = linear.r - explained
    return np.array([_dot(linear.jp[:, a], r, _ROWS[a]) for a in range(POSE)])


def _fill(linear: LinearChunk, coupling: FloatArray, buffer: FloatArray) -> None:
    """Write Z = B^T J_p of every observation in a free frame into the blocks."""
    buffer[:] = 0.0
    chunk, jp = linear.chunk, linear.jp
    everything = len(chunk.seen) == len(chunk.frame)
    for c in range(3):
        entry = chunk.entry[:, c]
        for a in range(POSE):
            value = _dot(jp[:, a], coupling[:, c], _ROWS[a])
            buffer[a:][entry] = value if everything else value[chunk.seen]


def point_steps(linear: Linearization, pose_step: FloatArray, damping: float) -> FloatArray:
    """(3, L) steps of the points that belong to (F, 6) steps of the poses."""
    steps = np.zeros((3, linear.landmarks))
    for part in linear.chunks:
        chunk, jp = part.chunk, part.jp
        step = pose_step[chunk.first_frame : chunk.first_frame + chunk.frames].T[:, chunk.frame]
        r = np.stack(
            [sum((jp[i, a] * step[a] for a in (1, 2, 3 + i, 5)), jp[i, 0] * step[0]) for i in range(2)]
        )
        points = factor_points(part, damping)
        moved = part.gradient + part.landmark_gradient(r)
        steps[:, chunk.landmarks] = -points.transposed_times(points.times(moved))
    return steps

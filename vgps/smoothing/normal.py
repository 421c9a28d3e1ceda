"""Normal equations of a bundle problem, with the landmarks eliminated: all observations at once, in arrays.

Poses move in GTSAM's tangent, ``world_T_camera * Expmap([rotation; translation])``, so the pose factors'
linearisation by GTSAM itself adds up with the observations'. Arrays over observations have the observation
last: the arithmetic then runs along contiguous memory.
"""

from dataclasses import dataclass

import numpy as np
from gtsam.symbol_shorthand import X
from scipy import sparse

from vgps.model import FloatArray, IntArray
from vgps.smoothing.band import POSE, Band, Grouping, group_landmarks
from vgps.smoothing.bundle import BundleProblem, camera_points, pose_values, residuals, robust_weight

MIN_DIAGONAL = 1e-6  # damped at least as if the diagonal were this, GTSAM's default
_PIVOT = 1e-14  # relative to the diagonal: what rounding leaves of a point seen along one ray
_LOWER = [(a, b) for a in range(POSE) for b in range(a + 1)]


@dataclass(frozen=True)
class Structure:
    """What stays the same while the poses and points move.

    Attributes:
        free: (F,) number among the frames that may move, -1 if held.
        n_free: Frames that may move.
        seen: (M,) observations in such frames.
        grouping: How their landmarks are eliminated.
        half_bandwidth: Of the reduced matrix.
        buffer: Room for the eliminated blocks; entries that are zero stay so.
    """

    free: IntArray
    n_free: int
    seen: IntArray
    grouping: Grouping
    half_bandwidth: int
    buffer: FloatArray

    @property
    def flops(self) -> float:
        """Multiplications and additions that one factorisation takes."""
        return self.grouping.flops + POSE * self.n_free * float(self.half_bandwidth) ** 2


@dataclass(frozen=True)
class Landmarks3:
    """Inverse Cholesky factors M of the points' (3, 3) blocks, M^T M = V^-1: ``m`` (6, L) row by row."""

    m: FloatArray

    def times(self, v: FloatArray) -> FloatArray:
        """M v for (3, L) v."""
        m = self.m
        return np.stack([m[0] * v[0], m[1] * v[0] + m[2] * v[1], m[3] * v[0] + m[4] * v[1] + m[5] * v[2]])

    def transposed_times(self, v: FloatArray) -> FloatArray:
        """M^T v for (3, L) v."""
        m = self.m
        return np.stack([m[0] * v[0] + m[1] * v[1] + m[3] * v[2], m[2] * v[1] + m[4] * v[2], m[5] * v[2]])


@dataclass(frozen=True)
class Linearization:
    """Whitened, reweighted Jacobians and what they sum up to.

    Attributes:
        jp: (2, 6, N) by the pose, jl (2, 3, N) by the landmark, r (2, N) residuals.
        frame, landmark: (N,).
        point_hessian: (6, L) lower triangles, point_gradient (3, L).
        pose_hessian: lower triangle of the poses' own part, pose_gradient (6 n_free,).
    """

    jp: FloatArray
    jl: FloatArray
    r: FloatArray
    frame: IntArray
    landmark: IntArray
    point_hessian: FloatArray
    point_gradient: FloatArray
    pose_hessian: sparse.coo_array
    pose_gradient: FloatArray

    @property
    def point_diagonal(self) -> FloatArray:
        """(3, L) diagonals of the points' blocks."""
        return np.maximum(self.point_hessian[[0, 2, 5]], MIN_DIAGONAL)

    @property
    def pose_diagonal(self) -> FloatArray:
        """(6 n_free,) diagonal of the poses' part."""
        diagonal: FloatArray = np.maximum(self.pose_hessian.diagonal(), MIN_DIAGONAL)
        return diagonal


def structure_of(problem: BundleProblem) -> Structure:
    """Order of the unknowns, bandwidth and blocks.

    Raises:
        ValueError: A landmark is seen twice in one frame.
    """
    moves = ~problem.fixed_frames
    free = np.where(moves, np.cumsum(moves) - 1, -1)
    seen = np.flatnonzero(moves[problem.frame])
    grouping = group_landmarks(free[problem.frame[seen]], problem.landmark[seen])
    span = max(grouping.span, _pose_graph_span(problem, free))
    return Structure(
        free, int(moves.sum()), seen, grouping, max(POSE * span - 1, POSE - 1), np.zeros(grouping.size)
    )


def _pose_graph_span(problem: BundleProblem, free: IntArray) -> int:
    span = 0
    for i in range(problem.pose_graph.size()):
        factor = problem.pose_graph.at(i)
        if factor is not None:
            frames = free[np.array(factor.keys(), dtype=np.int64) - X(0)]
            frames = frames[frames >= 0]
            span = max(span, int(np.ptp(frames)) + 1 if len(frames) else 0)
    return span


def linearize(problem: BundleProblem, structure: Structure) -> Linearization:
    """Jacobians of all observations and the pose factors at the problem's poses and points.

    With x, y, z the point in the camera, d(x, y, z) = [(x, y, z)]_x rotation - translation + R^T d(point).
    Behind the camera the Jacobians are zero, as in GTSAM.
    """
    camera_p = camera_points(problem)
    error, behind = residuals(problem, camera_p)
    squared = np.sum(error**2, axis=0) / problem.sigma_px**2
    scale = np.sqrt(robust_weight(problem, squared)) / problem.sigma_px
    scale_of_jacobian = np.where(behind, 0.0, scale)
    jp, jl = _jacobians(problem, camera_p, scale_of_jacobian)
    r = error * scale
    count, landmarks = len(problem.world_T_camera), len(problem.world_p_landmark)
    point = _sums(jl, r, problem.landmark, landmarks)
    pose = _sums(jp, r, problem.frame, count)
    hessian, gradient = _pose_graph_normal(problem, structure)
    own = _block_diagonal(pose[0][:, structure.free >= 0])
    gradient += pose[1][:, structure.free >= 0].T.ravel()
    total = (hessian + own).tocoo()
    return Linearization(jp, jl, r, problem.frame, problem.landmark, *point, total, gradient)


def _jacobians(
    problem: BundleProblem, camera_p: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray]:
    fx, fy, _, _ = problem.K
    n = len(scale)
    depth = np.where(camera_p[2] > 0.0, camera_p[2], 1.0)
    x, y = camera_p[0] / depth, camera_p[1] / depth
    su, sv = fx * scale, fy * scale
    du, dv = su / depth, sv / depth
    jp = np.zeros((2, POSE, n))
    jp[0, 0], jp[0, 1], jp[0, 2] = su * x * y, -su * (1.0 + x * x), su * y
    jp[1, 0], jp[1, 1], jp[1, 2] = sv * (1.0 + y * y), -sv * x * y, -sv * x
    jp[0, 3], jp[0, 5] = -du, du * x
    jp[1, 4], jp[1, 5] = -dv, dv * y
    jl = np.empty((2, 3, n))
    for axis in range(3):
        R = [problem.world_T_camera[:, axis, column][problem.frame] for column in range(3)]
        jl[0, axis] = du * (R[0] - x * R[2])
        jl[1, axis] = dv * (R[1] - y * R[2])
    return jp, jl


def _sums(j: FloatArray, r: FloatArray, index: IntArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Lower triangles of sum J^T J, row by row, and sum J^T r, per pose or landmark."""
    columns = j.shape[1]
    hessian = [
        np.bincount(index, j[0, a] * j[0, b] + j[1, a] * j[1, b], size)
        for a in range(columns)
        for b in range(a + 1)
    ]
    gradient = [np.bincount(index, j[0, a] * r[0] + j[1, a] * r[1], size) for a in range(columns)]
    return np.array(hessian), np.array(gradient)


def _block_diagonal(blocks: FloatArray) -> sparse.csr_array:
    n = blocks.shape[1]
    rows, columns = np.array(_LOWER).T
    at = POSE * np.arange(n)
    index = ((at + rows[:, None]).ravel(), (at + columns[:, None]).ravel())
    return sparse.csr_array((blocks.ravel(), index), shape=(POSE * n, POSE * n))


def _pose_graph_normal(problem: BundleProblem, structure: Structure) -> tuple[sparse.csr_array, FloatArray]:
    """Lower triangle of J^T J and J^T r of the pose factors, linearised by GTSAM."""
    n = POSE * structure.n_free
    frames = problem.pose_graph_frames
    if not len(frames):
        return sparse.csr_array((n, n)), np.zeros(n)
    row, column, value = problem.pose_graph.linearize(pose_values(problem)).sparseJacobian_()
    # one-based; the columns follow the keys in ascending order, the right-hand side is the last
    row, column = row.astype(np.int64) - 1, column.astype(np.int64) - 1
    right = column == POSE * len(frames)
    b = np.zeros(int(row.max(initial=-1)) + 1)
    b[row[right]] = value[right]
    number = structure.free[frames]
    target = POSE * number[np.minimum(column // POSE, len(frames) - 1)] + column % POSE
    keep = ~right & (target >= 0)
    A = sparse.csr_array((value[keep], (row[keep], target[keep])), shape=(len(b), n))
    return sparse.tril(A.T @ A, format="csr"), -(A.T @ b)


def factor_points(linear: Linearization, damping: float) -> Landmarks3:
    """Cholesky factors of the points' blocks with ``damping`` times their diagonal added.

    A point seen once, or along nearly one ray, has a singular block: the damping, or failing that a pivot
    held above rounding, lets it keep its depth.
    """
    a, b, c, d, e, f = linear.point_hessian
    da, dc, df = damping * linear.point_diagonal
    a, c, f = a + da, c + dc, f + df
    l11 = np.sqrt(np.maximum(a, 1e-300))
    l21, l31 = b / l11, d / l11
    l22 = np.sqrt(np.maximum(c - l21 * l21, _PIVOT * c + 1e-300))
    l32 = (e - l21 * l31) / l22
    l33 = np.sqrt(np.maximum(f - l31 * l31 - l32 * l32, _PIVOT * f + 1e-300))
    m11, m22, m33 = 1.0 / l11, 1.0 / l22, 1.0 / l33
    m21, m32 = -m22 * l21 * m11, -m33 * l32 * m22
    m31 = -m33 * (l31 * m11 + l32 * m21)
    return Landmarks3(np.stack([m11, m21, m22, m31, m32, m33]))


def reduce_to_poses(
    linear: Linearization, structure: Structure, points: Landmarks3, damping: float
) -> tuple[Band, FloatArray]:
    """Schur complement on the free poses with ``damping`` times its own diagonal added, and its gradient."""
    m = [component[linear.landmark] for component in points.m]
    y = [component[linear.landmark] for component in points.times(linear.point_gradient)]
    jl = linear.jl
    B = [
        [
            jl[i, 0] * m[0],
            jl[i, 0] * m[1] + jl[i, 1] * m[2],
            jl[i, 0] * m[3] + jl[i, 1] * m[4] + jl[i, 2] * m[5],
        ]
        for i in range(2)
    ]
    explained = np.stack([B[i][0] * y[0] + B[i][1] * y[1] + B[i][2] * y[2] for i in range(2)])
    gradient = linear.pose_gradient - _pose_sums(linear, structure, explained)
    n = POSE * structure.n_free
    rows = max([structure.half_bandwidth, *(g.width for g in structure.grouping.groups if g.contiguous)]) + 1
    band = Band.zeros(n, rows)
    hessian = linear.pose_hessian
    band.add_entries(hessian.row.astype(np.int64), hessian.col.astype(np.int64), hessian.data)
    band.add_diagonal(damping * linear.pose_diagonal)
    _fill(linear, structure, B)
    for group in structure.grouping.groups:
        group.subtract_square(structure.buffer, band)
    return band, gradient


def _pose_sums(linear: Linearization, structure: Structure, r: FloatArray) -> FloatArray:
    count = len(structure.free)
    sums = [
        np.bincount(linear.frame, linear.jp[0, a] * r[0] + linear.jp[1, a] * r[1], count) for a in range(POSE)
    ]
    summed: FloatArray = np.array(sums)
    return summed[:, structure.free >= 0].T.ravel()


def _fill(linear: Linearization, structure: Structure, B: list[list[FloatArray]]) -> None:
    """Write Z = M W^T, W the poses' coupling to the landmarks, into the buffer of blocks."""
    everything = len(structure.seen) == len(linear.frame)
    seen = slice(None) if everything else structure.seen
    for c in range(3):
        entry = structure.grouping.entry[:, c]
        for a in range(POSE):
            value = linear.jp[0, a] * B[0][c] + linear.jp[1, a] * B[1][c]
            structure.buffer[a:][entry] = value[seen]


def point_steps(linear: Linearization, points: Landmarks3, pose_step: FloatArray) -> FloatArray:
    """(L, 3) steps of the points that belong to (F, 6) steps of the poses."""
    size = linear.point_hessian.shape[1]
    step = [pose_step[:, a][linear.frame] for a in range(POSE)]
    moved = [sum(linear.jp[i, a] * step[a] for a in range(POSE)) for i in range(2)]
    coupled = [
        np.bincount(linear.landmark, linear.jl[0, k] * moved[0] + linear.jl[1, k] * moved[1], size)
        for k in range(3)
    ]
    right = points.times(linear.point_gradient + np.array(coupled))
    return -points.transposed_times(right).T

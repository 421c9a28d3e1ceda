"""Elimination of the landmarks: the Schur complement on the poses, and the landmarks' steps from the poses'.

With poses p and landmarks l, ``[H_pp H_pl; H_lp H_ll]`` reduces to ``H_pp - H_pl H_ll^-1 H_lp``, where H_ll
consists of (3, 3) blocks. Each is factored as ``H_ll^-1 = M^T M``, so that every observation contributes
``Z = M J_l^T J_p`` and every group of landmarks subtracts one product ``Z^T Z``.
"""

from dataclasses import dataclass
from queue import Empty, SimpleQueue

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.runtime.threads import map_in_order
from vgps.solver.equations.chunks import Chunk
from vgps.solver.equations.elimination import PoseMatrix, SparsityStructure
from vgps.solver.equations.linearised_chunk import LinearisedChunk
from vgps.solver.equations.normal_equations import Linearisation
from vgps.solver.matrices.band_matrix import POSE_DIM

_MIN_DEPTH = 1e-14  # information along a single ray, relative to that across: what rounding errors leave


@dataclass(frozen=True)
class LandmarkFactors:
    """Inverse Cholesky factors M of the landmarks' (3, 3) blocks V, ``M^T M = V^-1``.

    Attributes:
        m: (6, m) lower triangles of M, row by row.
    """

    m: FloatArray

    def times(self, v: FloatArray) -> FloatArray:
        """Return M v for (3, m) v."""
        m = self.m
        return np.stack([m[0] * v[0], m[1] * v[0] + m[2] * v[1], m[3] * v[0] + m[4] * v[1] + m[5] * v[2]])

    def transposed_times(self, v: FloatArray) -> FloatArray:
        """Return M^T v for (3, m) v."""
        m = self.m
        return np.stack([m[0] * v[0] + m[1] * v[1] + m[3] * v[2], m[2] * v[1] + m[4] * v[2], m[5] * v[2]])


def factorise_landmarks(linear: LinearisedChunk, damping: FloatArray | float) -> LandmarkFactors:
    """Factor the landmarks' blocks with ``damping``, a number or (m,), times their diagonal added.

    A landmark observed once, without parallax, or far away has a singular block. The damping, or without it a
    lower bound of the information in any direction, keeps its depth: rounding errors of it would otherwise
    count as information, and the complement become indefinite.
    """
    a, b, c, d, e, f = linear.hessian
    more = damping * linear.diagonal
    a, c, f = a + more[0], c + more[1], f + more[2]
    least = _MIN_DEPTH * (a + c + f) + 1e-300
    m11 = 1.0 / np.sqrt(np.maximum(a, 1e-300))
    l21, l31 = b * m11, d * m11
    u21 = -l21 * m11  # rows of M are u times the inverse root of a pivot
    m22 = 1.0 / np.sqrt(np.maximum(c - l21 * l21, least * (u21 * u21 + 1.0)))
    l32 = (e - l21 * l31) * m22
    u32 = -l32 * m22
    u31 = u32 * u21 - l31 * m11
    m33 = 1.0 / np.sqrt(np.maximum(f - l31 * l31 - l32 * l32, least * (u31 * u31 + u32 * u32 + 1.0)))
    return LandmarkFactors(np.stack([m11, u21 * m22, m22, u31 * m33, u32 * m33, m33]))


def reduce_to_poses(
    linear: Linearisation, structure: SparsityStructure, damping: float
) -> tuple[PoseMatrix, FloatArray]:
    """Return the Schur complement on free poses and states, and its gradient.

    Args:
        linear: Linearisation of the problem.
        structure: Structure of the problem.
        damping: Added to poses, states and landmarks, relative to their diagonals.

    Returns:
        The matrix over free poses and states, and the gradient (6 n_free,).
    """
    matrix = structure.empty()
    hessian = linear.hessian
    matrix.add_entries(hessian.row.astype(np.int64), hessian.col.astype(np.int64), hessian.data)
    matrix.add_diagonal(damping * linear.diagonal)
    explained = np.zeros((POSE_DIM, len(structure.free)))
    spare: SimpleQueue[FloatArray] = SimpleQueue()  # memory to use again: new pages take time
    size = max((chunk.size for chunk in structure.chunks), default=0)

    def filled(part: LinearisedChunk) -> tuple[Chunk, FloatArray, FloatArray]:
        coupling, r = _coupling(part, factorise_landmarks(part, damping))
        try:
            buffer = spare.get_nowait()
        except Empty:
            buffer = np.empty(size)
        _fill_groups(part, coupling, buffer[: part.chunk.size])
        return part.chunk, part.pose_gradient(r), buffer

    for chunk, gradient, buffer in map_in_order(filled, linear.chunks):
        explained[:, chunk.first_frame : chunk.first_frame + chunk.frames] += gradient
        for group in chunk.groups:
            matrix.subtract_square(group.frames, group.matrix(buffer))
        spare.put(buffer)
    return matrix, linear.gradient - structure.to_columns(explained.T)


def _coupling(linear: LinearisedChunk, factors: LandmarkFactors) -> tuple[FloatArray, FloatArray]:
    """Return B = J_l M^T of each observation (2, 3, n), and the residuals (2, n) that landmarks absorb."""
    at, jl = linear.chunk.landmark, linear.jl
    m = factors.m.take(at, axis=1)
    y = factors.times(linear.gradient).take(at, axis=1)
    B = np.empty_like(jl)
    for i in range(2):
        B[i, 0] = jl[i, 0] * m[0]
        B[i, 1] = jl[i, 0] * m[1] + jl[i, 1] * m[2]
        B[i, 2] = jl[i, 0] * m[3] + jl[i, 1] * m[4] + jl[i, 2] * m[5]
    return B, B[:, 0] * y[0] + B[:, 1] * y[1] + B[:, 2] * y[2]


def absorbed_residuals(part: LinearisedChunk, r: FloatArray) -> FloatArray:
    """Return the part of residuals (2, n) that the landmarks absorb."""
    factors = factorise_landmarks(part, 0.0)
    step = factors.transposed_times(factors.times(part.landmark_gradient(r)))[:, part.chunk.landmark]
    return np.asarray(np.einsum("ian,an->in", part.jl, step))


def pose_scores(linear: LinearisedChunk) -> FloatArray:
    """Return the contribution of each coupled pair to the reduced gradient, (6, c)."""
    _, explained = _coupling(linear, factorise_landmarks(linear, 0.0))
    r = linear.r - explained
    return np.array(linear.pose_products(r))


def _fill_groups(linear: LinearisedChunk, coupling: FloatArray, buffer: FloatArray) -> None:
    """Write Z = B^T J_p of every coupled pair with a free frame into the matrices of the groups."""
    buffer[:] = 0.0
    chunk = linear.chunk
    all_free = len(chunk.free_rows) == len(chunk.coupled.frame)
    for c in range(3):
        entry = chunk.entry[:, c]
        for a, value in enumerate(linear.pose_products(coupling[:, c])):
            buffer[a:][entry] = value if all_free else value[chunk.free_rows]


def landmark_steps(linear: Linearisation, pose_step: FloatArray, damping: float) -> FloatArray:
    """Return the landmarks' steps (3, L) that follow from the poses' steps (F, 6)."""

    def step(part: LinearisedChunk) -> tuple[IntArray, FloatArray]:
        factors = factorise_landmarks(part, damping)
        gradient = part.gradient + part.landmark_gradient(part.moved_by_poses(pose_step))
        return part.chunk.landmarks, -factors.transposed_times(factors.times(gradient))

    steps = np.zeros((3, linear.landmarks))
    for landmarks, found in map_in_order(step, linear.chunks):
        steps[:, landmarks] = found
    return steps

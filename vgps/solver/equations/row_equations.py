"""Normal equations of a rolling shutter: an observation moves with the frames around its row's time.

The row's pose comes from a weighted sum of the vectors of k frames (:mod:`factors.continuous_path`). So the
Jacobian by a frame is ``w_k Q E``: the weight, the derivative Q (2, 7) of the residual by the sum, and E
(7, 6), of the frame alone. Everything is summed by landmark and frame with the weights first, and multiplied
by E afterwards.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from factors.continuous_path import MAX_KNOTS, VECTOR_DIM, rotation_jacobians, vector_jacobians
from vgps.model import FloatArray
from vgps.solver.equations.linearised_chunk import LOWER, LinearisedChunk
from vgps.solver.equations.unknowns import Unknowns
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.row_times import RowTimes

_SYMMETRIC = tuple((a, b) for a in range(VECTOR_DIM) for b in range(a + 1))


@dataclass(frozen=True, kw_only=True)
class RollingChunk(LinearisedChunk):
    """A chunk whose observations move with several frames; ``jp`` is by the pose of the row.

    Attributes:
        row_times: Times of the observations.
        vectors: (frames from the first knot to the last, 7) vectors of their poses.
    """

    row_times: RowTimes
    vectors: FloatArray

    @cached_property
    def by_vector(self) -> FloatArray:
        """(7, 2, n) Jacobians by the weighted sum of the knots' vectors."""
        by_rotation = rotation_jacobians((self.row_times.matrix @ self.vectors)[:, :4])
        J = np.empty((VECTOR_DIM, *self.r.shape))
        for column in range(4):
            J[column] = sum(self.jp[:, a] * by_rotation[:, a, column] for a in range(3))
        J[4:] = -self.jl.transpose(1, 0, 2)
        return J

    @cached_property
    def by_readout(self) -> FloatArray:
        """(2, n) Jacobian by the readout."""
        return self.moved_by_vectors((self.row_times.by_readout @ self.vectors).T)

    @cached_property
    def _by_landmark_and_frame(self) -> sparse.csc_array:
        """(c, n) weights of the observations in the pairs of landmark and frame that they couple."""
        weights, pair = self.row_times.weights, self.chunk.coupled.pair
        shape = (len(self.chunk.coupled.frame), len(weights))
        index = (pair.ravel(), weights.shape[1] * np.arange(len(weights) + 1))
        return sparse.csc_array((weights.ravel(), *index), shape=shape)

    @cached_property
    def _by_pose(self) -> FloatArray:
        """(7, 6, frames) derivatives of the frames' vectors by their poses."""
        return np.ascontiguousarray(vector_jacobians(self.vectors).transpose(1, 2, 0))

    def _vector_products(self, r: FloatArray) -> FloatArray:
        return np.ascontiguousarray((self.by_vector[:, 0] * r[0] + self.by_vector[:, 1] * r[1]).T)

    def pose_products(self, r: FloatArray) -> list[FloatArray]:
        """Return J_p^T r for any (2, n) r: for each pose coordinate, (c,) by landmark and frame."""
        total = np.ascontiguousarray((self._by_landmark_and_frame @ self._vector_products(r)).T)
        return self._to_tangent(total, self._coupled_by_pose)

    @cached_property
    def _coupled_by_pose(self) -> FloatArray:
        """(7, 6, c) derivatives of the vectors of the coupled frames."""
        return self._by_pose[:, :, self.chunk.coupled.frame]

    @staticmethod
    def _to_tangent(total: FloatArray, by_pose: FloatArray) -> list[FloatArray]:
        """Return the products (6) of sums (7, c) with the derivatives by poses, whose other entries are 0."""
        turned = np.einsum("jc,jac->ac", total[:4], by_pose[:4, :3])
        return [*turned, *np.einsum("jc,jac->ac", total[4:], by_pose[4:, 3:])]

    def pose_gradient(self, r: FloatArray) -> FloatArray:
        """Return the sums of J_p^T r by pose, (6, frames of the chunk), for any (2, n) r."""
        total = np.ascontiguousarray((self.row_times.matrix.T @ self._vector_products(r)).T)
        return np.array(self._to_tangent(total, self._by_pose))

    def pair_blocks(self) -> FloatArray:
        """Return the blocks (k, frames, 6, 6) of each frame's rows with the columns of the frame k earlier.

        The sums of ``w_i w_j Q^T Q`` over observations with the same knots come first, then the Jacobians E.
        """
        frames, knots = len(self.vectors), self.row_times.knots.shape[1]
        blocks = np.zeros((knots, frames, POSE_DIM, POSE_DIM))
        by_pose, last = self._by_pose.transpose(2, 0, 1), frames - knots + 1
        pairs = [(i, j) for i in range(knots) for j in range(i + 1)]
        sums = self._pair_sums(pairs)[:last]
        squares = np.empty((last, VECTOR_DIM, VECTOR_DIM))
        for at, (i, j) in enumerate(pairs):
            for column, (a, b) in enumerate(_SYMMETRIC):
                squares[:, a, b] = squares[:, b, a] = sums[:, at, column]
            rows, columns = by_pose[i : i + last], by_pose[j : j + last]
            blocks[i - j, i : i + last] += rows.transpose(0, 2, 1) @ squares @ columns
        return blocks

    def _pair_sums(self, pairs: Sequence[tuple[int, int]]) -> FloatArray:
        """Return the sums (frames, pairs, 28) of ``w_i w_j Q^T Q`` by the first knot."""
        Q, times, count = self.by_vector, self.row_times, len(pairs)
        squares = np.empty((len(times.share), len(_SYMMETRIC)))
        for column, (a, b) in enumerate(_SYMMETRIC):
            squares[:, column] = Q[a, 0] * Q[b, 0] + Q[a, 1] * Q[b, 1]
        products = np.stack([times.weights[:, i] * times.weights[:, j] for i, j in pairs], axis=1)
        row = (times.knots[:, :1] - self.chunk.first_frame) * count + np.arange(count)
        index = (row.ravel(), count * np.arange(len(squares) + 1))
        shape = (len(self.vectors) * count, len(squares))
        by_first = sparse.csc_array((products.ravel(), *index), shape=shape)
        return np.asarray(by_first @ squares).reshape(len(self.vectors), count, -1)

    def moved_by_poses(self, pose_step: FloatArray) -> FloatArray:
        """Return J_p times the steps (F, 6) of all frames, (2, n)."""
        chunk = self.chunk
        step = pose_step[chunk.first_frame : chunk.first_frame + chunk.frames]
        moved = self.row_times.matrix @ np.einsum("jaf,fa->fj", self._by_pose, step)
        return self.moved_by_vectors(moved.T)

    def moved_by_vectors(self, change: FloatArray) -> FloatArray:
        """Return the change (2, n) of the residuals by changes (7, n) of the knots' weighted sums."""
        return np.asarray(np.einsum("jin,jn->in", self.by_vector, change))


def rolling_blocks(
    chunks: Sequence[LinearisedChunk], unknowns: Unknowns
) -> tuple[FloatArray, sparse.csr_array]:
    """Return the frames' blocks (21, F), and the lower triangle (6 n_free, 6 n_free) of pairs of frames."""
    frames = len(unknowns.free)
    blocks = np.zeros((min(MAX_KNOTS, frames), frames, POSE_DIM, POSE_DIM))
    for part in chunks:
        if isinstance(part, RollingChunk):
            first = part.chunk.first_frame
            blocks[:, first : first + part.chunk.frames] += part.pair_blocks()
    return np.array([blocks[0, :, a, b] for a, b in LOWER]), _between_frames(blocks[1:], unknowns)


def _between_frames(blocks: FloatArray, unknowns: Unknowns) -> sparse.csr_array:
    """Return the matrix of blocks (k, F, 6, 6) of a frame's rows with the columns of a frame 1..k earlier."""
    rows, columns, values = [], [], []
    inner = np.arange(POSE_DIM)
    for earlier, block in enumerate(blocks, start=1):
        row, column = unknowns.free[earlier:], unknowns.free[:-earlier]
        free = np.flatnonzero((row >= 0) & (column >= 0))
        rows.append(np.broadcast_to(POSE_DIM * row[free, None, None] + inner[:, None], (len(free), 6, 6)))
        columns.append(np.broadcast_to(POSE_DIM * column[free, None, None] + inner, (len(free), 6, 6)))
        values.append(block[earlier:][free])
    size = POSE_DIM * unknowns.n_free
    if not values:
        return sparse.csr_array((size, size))
    index = tuple(np.concatenate(part).ravel() for part in (rows, columns))
    return sparse.csr_array((np.concatenate(values).ravel(), index), shape=(size, size))

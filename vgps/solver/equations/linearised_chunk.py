"""Jacobians of a chunk's observations, and what the poses and the landmarks get from them.

Arrays over observations have the observation as their last axis, so that arithmetic runs along contiguous
memory.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vgps.model import FloatArray
from vgps.solver.equations.chunks import Chunk
from vgps.solver.equations.pose_equations import MIN_DIAGONAL
from vgps.solver.matrices.band_matrix import POSE_DIM

LOWER = tuple((a, b) for a in range(POSE_DIM) for b in range(a + 1))
"""Rows and columns of the lower triangle of a pose's block, row by row."""


@dataclass(frozen=True, kw_only=True)
class LinearisedChunk:
    """Whitened, reweighted Jacobians of a chunk's observations, and its landmarks' normal equations.

    Attributes:
        chunk: The observations.
        jp, jl: (2, 6, n) and (2, 3, n) Jacobians to the pose and to the landmark.
        r: (2, n) residuals.
        hessian: (6, m) lower triangles of the landmarks' blocks, row by row.
        gradient: (3, m).
    """

    chunk: Chunk
    jp: FloatArray
    jl: FloatArray
    r: FloatArray
    hessian: FloatArray
    gradient: FloatArray

    moves: ClassVar[tuple[tuple[int, ...], ...]] = ((0, 1), (0, 1), (0, 1), (0,), (1,), (0, 1))
    """Image coordinates (u, v) that each pose coordinate moves."""

    @property
    def diagonal(self) -> FloatArray:
        """(3, m) diagonals by which damping is scaled."""
        return np.maximum(self.hessian[[0, 2, 5]], MIN_DIAGONAL)

    def pose_products(self, r: FloatArray) -> list[FloatArray]:
        """Return J_p^T r for any (2, n) r: for each pose coordinate, (c,) by landmark and frame.

        The landmarks and frames are those of ``chunk.coupled``.
        """
        return [dot(self.jp[:, a], r, rows) for a, rows in enumerate(self.moves)]

    def pose_gradient(self, r: FloatArray) -> FloatArray:
        """Return the sums of J_p^T r by pose, (6, frames of the chunk), for any (2, n) r."""
        return np.array([self.chunk.sum_by_frame(product) for product in self.pose_products(r)])

    def moved_by_poses(self, pose_step: FloatArray) -> FloatArray:
        """Return J_p times the steps (F, 6) of all frames, (2, n)."""
        chunk, jp = self.chunk, self.jp
        own = pose_step[chunk.first_frame : chunk.first_frame + chunk.frames].T
        step = np.ascontiguousarray(own).take(chunk.frame, axis=1)
        moving = ([a for a, rows in enumerate(self.moves) if i in rows] for i in range(2))
        return np.stack([sum(jp[i, a] * step[a] for a in columns) for i, columns in enumerate(moving)])

    def landmark_gradient(self, r: FloatArray) -> FloatArray:
        """Return the sums of J_l^T r by landmark, (3, m), for any (2, n) r."""
        at, size = self.chunk.landmark, len(self.chunk.landmarks)
        return np.array([np.bincount(at, dot(self.jl[:, k], r), size) for k in range(3)])


class DenseChunk(LinearisedChunk):
    """A chunk in which every pose coordinate moves both image coordinates.

    So it is on a rig, where a turn of the reference camera moves the others to all sides, and behind a wide
    lens, whose errors are those of the picture.
    """

    moves: ClassVar = ((0, 1),) * POSE_DIM


def pose_blocks(linear: LinearisedChunk) -> FloatArray:
    """Return the lower triangles of the poses' blocks, row by row: (21, frames of the chunk)."""
    jp, chunk = linear.jp, linear.chunk
    blocks = np.zeros((len(LOWER), chunk.frames))
    for row, (a, b) in enumerate(LOWER):
        rows = tuple(i for i in linear.moves[a] if i in linear.moves[b])
        if rows:
            blocks[row] = chunk.sum_by_frame(dot(jp[:, a], jp[:, b], rows))
    return blocks


def dot(p: FloatArray, q: FloatArray, rows: tuple[int, ...] = (0, 1)) -> FloatArray:
    """Return the products (n,) of two arrays' rows, summed over the rows that are not zero."""
    total: FloatArray = p[rows[0]] * q[rows[0]]
    for row in rows[1:]:
        total += p[row] * q[row]
    return total

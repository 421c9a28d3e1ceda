"""A block-sparse symmetric matrix over poses, for videos that revisit places.

A band would be full between the first visit of a place and the last; here only blocks with entries are
stored. Blocks are eliminated in order of minimum degree, and each column of blocks is one dense panel, so
that nearly all work is dense products.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas, lapack

from vgps.model import FloatArray, IntArray
from vgps.solver.disk_arrays import DiskArrays
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.matrices.block_cholesky import factorise_blocks
from vgps.solver.matrices.block_layout import BLOCK_FRAMES, BlockLayout
from vgps.solver.matrices.dense_products import subtract_blocks


@dataclass(frozen=True)
class BlockSparseMatrix:
    """A symmetric matrix, its Cholesky factor or its inverse.

    Attributes:
        layout: Stored blocks and their positions in ``flat``.
        flat: (layout.size,) the entries.
        arrays: Where they are stored; None for memory.
    """

    layout: BlockLayout
    flat: FloatArray
    arrays: DiskArrays | None = None

    @classmethod
    def zeros(cls, layout: BlockLayout, on_disk: bool = False) -> "BlockSparseMatrix":
        """Return a zero matrix."""
        if on_disk:
            arrays = DiskArrays()
            return cls(layout, arrays.empty((layout.size,)), arrays)
        return cls(layout, np.zeros(layout.size))

    def _passed(self, size: int) -> None:
        """Say that so many bytes were in use, which may leave the memory if they are on disk."""
        if self.arrays is not None:
            self.arrays.passed(size)

    def block(self, row: int, column: int) -> FloatArray:
        """Return a view of a stored block."""
        shape = self.layout.width(row), self.layout.width(column)
        at = int(self.layout.start[row, column])
        return self.flat[at : at + shape[0] * shape[1]].reshape(shape)

    def panel(self, column: int) -> FloatArray:
        """Return a view of a column of blocks below its diagonal block."""
        return self.layout.column(column, self.flat)[self.layout.width(column) :]

    def subtract_square(self, frames: IntArray, Z: FloatArray) -> None:
        """Subtract Z^T Z, for Z (k, 6 s), over ascending frames (s,)."""
        subtract_blocks(Z, self.layout.pieces_of(frames), self.flat)
        self._passed(8 * Z.shape[1] ** 2)

    def add_entries(self, rows: IntArray, columns: IntArray, values: FloatArray) -> None:
        """Add to entries of the lower triangle, each of which is given once."""
        layout, size = self.layout, POSE_DIM * BLOCK_FRAMES
        transposed = layout.rank[rows // size] < layout.rank[columns // size]
        i, j = np.where(transposed, columns, rows), np.where(transposed, rows, columns)
        block = j // size
        widths = np.minimum(layout.columns - size * block, size)
        self.flat[layout.start[i // size, block] + (i % size) * widths + j % size] += values
        self._passed(self.flat.nbytes)

    def add_diagonal(self, values: FloatArray) -> None:
        """Add (n,) values to the diagonal."""
        every = np.arange(self.layout.columns)
        self.add_entries(every, every, values)

    def cholesky(self, min_pivot: FloatArray | float = 0.0) -> "BlockSparseMatrix":
        """Return the factor L of A = L L^T, in order of elimination.

        Raises:
            NotPositiveDefiniteError: There is none, or a squared pivot is not above ``min_pivot``, a number
                or (n,).
        """
        layout, on_disk = self.layout, self.arrays is not None
        factor = self.zeros(layout, on_disk) if on_disk else BlockSparseMatrix(layout, np.empty(layout.size))
        least = np.broadcast_to(min_pivot, layout.columns)

        def passed(size: int) -> None:
            self._passed(size)
            factor._passed(size)

        factorise_blocks(layout, self.flat, factor.flat, least, passed)
        return factor

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve ``L L^T x = right``, where L is this factor; ``right`` is (n,) or (n, k)."""
        x = np.array(right, dtype=np.float64).reshape(self.layout.columns, -1)
        if x.size == 0:
            return right
        order = self.layout.order.tolist()
        rows = {k: self.layout.rows_below(k) for k in order}
        for k in order:
            span = self.layout.span(k)
            x[span] = blas.dtrsm(1.0, self.block(k, k), x[span], lower=1)
            x[rows[k]] -= self.panel(k) @ x[span]
            self._passed(self.panel(k).nbytes)
        for k in reversed(order):
            span = self.layout.span(k)
            rest = x[span] - self.panel(k).T @ x[rows[k]]
            x[span] = blas.dtrsm(1.0, self.block(k, k), rest, lower=1, trans_a=1)
            self._passed(self.panel(k).nbytes)
        return x.reshape(right.shape)

    def inverse_diagonal_blocks(self) -> FloatArray:
        """Return the diagonal blocks (n / 6, 6, 6) of (L L^T)^-1, where L is this factor.

        The inverse is computed where the factor has entries, last column first (Takahashi, Fagan and Chen
        1973). With W = P D^-1 for a column's diagonal block D and panel P, and S the inverse over the rows of
        the panel, the inverse's panel is -S W and its diagonal block D^-T D^-1 + W^T S W.
        """
        layout, inverse = self.layout, self.zeros(self.layout, on_disk=self.arrays is not None)
        blocks = np.empty((layout.columns // POSE_DIM, POSE_DIM, POSE_DIM))
        for k in reversed(layout.order.tolist()):
            D, panel = self.block(k, k), self.panel(k)
            D_inverse, _ = lapack.dtrtri(np.asfortranarray(D), lower=1)
            D_inverse = np.tril(D_inverse)
            diagonal = D_inverse.T @ D_inverse
            if len(panel):
                W = panel @ D_inverse
                inverse.panel(k)[:] = -inverse._symmetric_over(layout.below[k]) @ W
                diagonal -= W.T @ inverse.panel(k)
            inverse.block(k, k)[:] = diagonal
            frames = len(diagonal) // POSE_DIM
            first = layout.span(k).start // POSE_DIM
            pairs = diagonal.reshape(frames, POSE_DIM, frames, POSE_DIM)
            blocks[first : first + frames] = np.einsum("iaib->iab", pairs)
            self._passed(panel.nbytes)
            inverse._passed((len(layout.below[k]) + 1) * panel.nbytes)
        return blocks

    def _symmetric_over(self, blocks: IntArray) -> FloatArray:
        """Return the dense symmetric matrix over blocks in order of elimination, all of which are stored."""
        size = sum(self.layout.width(i) for i in blocks.tolist())
        dense = np.empty((size, size))
        for block, rows, columns in self._blocks_over(blocks):
            dense[rows, columns] = block
            dense[columns, rows] = block.T
        return dense

    def _blocks_over(self, blocks: IntArray) -> Iterator[tuple[FloatArray, slice, slice]]:
        """Yield views of the stored blocks over some blocks, with their rows and columns in the submatrix."""
        numbers = blocks.tolist()
        ends = np.cumsum([self.layout.width(i) for i in numbers]).tolist()
        spans = [slice(begin, end) for begin, end in zip([0, *ends[:-1]], ends, strict=True)]
        for j, column in enumerate(numbers):
            for i in range(j, len(numbers)):
                yield self.block(numbers[i], column), spans[i], spans[j]

"""A symmetric matrix over frames in tiles, most of them empty: where places are seen again.

A band is full between the first and the last visit; here only what hangs together is stored. The tiles are
eliminated in an order of least degree, and every tile's column is one dense panel, so that the work is that
of dense products.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas, lapack

from vgps.model import FloatArray, IntArray
from vgps.solver.band_matrix import POSE, NotPositiveDefiniteError
from vgps.solver.block_layout import TILE, TileLayout


@dataclass(frozen=True)
class Tiles:
    """A matrix, a factor or an inverse in tiles; ``flat`` holds them as ``layout`` says."""

    layout: TileLayout
    flat: FloatArray

    @classmethod
    def zeros(cls, layout: TileLayout) -> "Tiles":
        """An empty matrix."""
        return cls(layout, np.zeros(layout.size))

    def tile(self, row: int, column: int) -> FloatArray:
        """View of a stored tile."""
        shape = self.layout.width(row), self.layout.width(column)
        at = int(self.layout.start[row, column])
        return self.flat[at : at + shape[0] * shape[1]].reshape(shape)

    def panel(self, tile: int) -> FloatArray:
        """View of a column below its diagonal tile."""
        width = self.layout.width(tile)
        at = int(self.layout.start[tile, tile]) + width * width
        rows = sum(self.layout.width(i) for i in self.layout.below[tile].tolist())
        return self.flat[at : at + rows * width].reshape(rows, width)

    def add_square(self, frames: IntArray, square: FloatArray) -> None:
        """Add a block over ascending frames (s,), (6 s, 6 s), zero above its diagonal."""
        tiles, begins = np.unique(frames // TILE, return_index=True)
        ends = np.append(begins[1:], len(frames))
        own = [
            POSE * (frames[a:b, None] - TILE * t) + np.arange(POSE)
            for t, a, b in zip(tiles, begins, ends, strict=True)
        ]
        index = [_as_slice(rows.ravel()) for rows in own]
        for i, row in enumerate(tiles.tolist()):
            for j, column in enumerate(tiles[: i + 1].tolist()):
                part = square[POSE * begins[i] : POSE * ends[i], POSE * begins[j] : POSE * ends[j]]
                if self.layout.place[row] >= self.layout.place[column]:
                    _add(self.tile(row, column), index[i], index[j], part)
                else:
                    _add(self.tile(column, row), index[j], index[i], part.T)

    def add_entries(self, rows: IntArray, columns: IntArray, values: FloatArray) -> None:
        """Add to entries of the lower triangle, each given once."""
        layout, size = self.layout, POSE * TILE
        turned = layout.place[rows // size] < layout.place[columns // size]
        i, j = np.where(turned, columns, rows), np.where(turned, rows, columns)
        tile = j // size
        widths = np.minimum(layout.columns - size * tile, size)
        self.flat[layout.start[i // size, tile] + (i % size) * widths + j % size] += values

    def add_diagonal(self, values: FloatArray) -> None:
        """Add (n,) values to the diagonal."""
        every = np.arange(self.layout.columns)
        self.add_entries(every, every, values)

    def cholesky(self, least_pivot: FloatArray | float = 0.0) -> "Tiles":
        """The factor L of L L^T, in the order of elimination.

        Raises:
            NotPositiveDefiniteError: There is none, or a squared pivot is below (n,) ``least_pivot``.
        """
        layout, factor = self.layout, Tiles(self.layout, self.flat.copy())
        least = np.broadcast_to(least_pivot, layout.columns)
        for k in layout.order.tolist():
            diagonal, span = factor.tile(k, k), layout.span(k)
            lower, info = lapack.dpotrf(diagonal, lower=1)
            if info > 0:
                raise NotPositiveDefiniteError(span.start + info - 1)
            small = ~(np.diagonal(lower) ** 2 > least[span])  # true of NaN as well
            if np.any(small):
                raise NotPositiveDefiniteError(span.start + int(np.argmax(small)))
            diagonal[:] = lower
            if len(layout.below[k]):
                panel = factor.panel(k)
                panel[:] = blas.dtrsm(1.0, lower, panel.T, lower=1).T
                factor._subtract_square(layout.below[k], blas.dsyrk(1.0, panel.T, trans=1, lower=1))
        return factor

    def _subtract_square(self, tiles: IntArray, square: FloatArray) -> None:
        """Over tiles in order of elimination; zero above the diagonal."""
        numbers = tiles.tolist()
        ends = np.cumsum([self.layout.width(i) for i in numbers]).tolist()
        begins = [0, *ends[:-1]]
        for j, column in enumerate(numbers):
            for i in range(j, len(numbers)):
                view = self.tile(numbers[i], column)
                view -= square[begins[i] : ends[i], begins[j] : ends[j]]

    def solve(self, right: FloatArray) -> FloatArray:
        """x of L L^T x = right, self being L; right (n,) or (n, k)."""
        x = np.array(right, dtype=np.float64).reshape(self.layout.columns, -1)
        if x.size == 0:
            return right
        order = self.layout.order.tolist()
        rows = {k: self.layout.rows_below(k) for k in order}
        for k in order:
            span = self.layout.span(k)
            x[span] = blas.dtrsm(1.0, self.tile(k, k), x[span], lower=1)
            x[rows[k]] -= self.panel(k) @ x[span]
        for k in reversed(order):
            span = self.layout.span(k)
            rest = x[span] - self.panel(k).T @ x[rows[k]]
            x[span] = blas.dtrsm(1.0, self.tile(k, k), rest, lower=1, trans_a=1)
        return x.reshape(right.shape)

    def inverse_diagonal_blocks(self) -> FloatArray:
        """(n / 6, 6, 6) diagonal blocks of (L L^T)^-1, self being L.

        The inverse is found where the factor has entries, last column first (Takahashi, Fagan and Chen 1973).
        With W = P D^-1 of a column's diagonal tile D and panel P, and S the inverse over its rows, the panel
        is -S W and the diagonal tile D^-T D^-1 + W^T S W.
        """
        layout, inverse = self.layout, Tiles.zeros(self.layout)
        blocks = np.empty((layout.columns // POSE, POSE, POSE))
        for k in reversed(layout.order.tolist()):
            D, panel = self.tile(k, k), self.panel(k)
            by_diagonal, _ = lapack.dtrtri(np.asfortranarray(D), lower=1)
            by_diagonal = np.tril(by_diagonal)
            own = by_diagonal.T @ by_diagonal
            if len(panel):
                W = panel @ by_diagonal
                inverse.panel(k)[:] = -inverse._gathered(layout.below[k]) @ W
                own -= W.T @ inverse.panel(k)
            inverse.tile(k, k)[:] = own
            frames = len(own) // POSE
            first = layout.span(k).start // POSE
            pairs = own.reshape(frames, POSE, frames, POSE)
            blocks[first : first + frames] = np.einsum("iaib->iab", pairs)
        return blocks

    def _gathered(self, tiles: IntArray) -> FloatArray:
        """The symmetric matrix over tiles in order of elimination, all of which are stored."""
        numbers = tiles.tolist()
        ends = np.cumsum([self.layout.width(i) for i in numbers]).tolist()
        begins = [0, *ends[:-1]]
        whole = np.empty((ends[-1], ends[-1]))
        for j, column in enumerate(numbers):
            for i in range(j, len(numbers)):
                part = self.tile(numbers[i], column)
                whole[begins[i] : ends[i], begins[j] : ends[j]] = part
                whole[begins[j] : ends[j], begins[i] : ends[i]] = part.T
        return whole


def _as_slice(index: IntArray) -> slice | IntArray:
    first, last = int(index[0]), int(index[-1])
    return slice(first, last + 1) if last - first + 1 == len(index) else index


def _add(tile: FloatArray, rows: slice | IntArray, columns: slice | IntArray, part: FloatArray) -> None:
    if isinstance(rows, slice) and isinstance(columns, slice):
        tile[rows, columns] += part
    else:
        every = np.arange(max(tile.shape))
        tile[np.ix_(every[rows], every[columns])] += part

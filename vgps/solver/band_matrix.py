"""A symmetric matrix over frames in order of time: assembled in blocks, factored and inverted as a band.

Storage is LAPACK's lower band, ``ab[i - j, j] = A[i, j]``, in Fortran order: entry (i, j) lies at
``i + j * (rows - 1)``, so a dense block of the matrix is a strided view of the band.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from vgps.model import FloatArray, IntArray

POSE = 6  # columns of a pose


class NotPositiveDefiniteError(ArithmeticError):
    """The matrix has no Cholesky factor.

    Args:
        column: The first whose pivot is not positive.
    """

    def __init__(self, column: int) -> None:
        self.column = column
        super().__init__(f"the pivot of column {column} is not positive")


@dataclass(frozen=True)
class Band:
    """The lower triangle of a symmetric (n, n) matrix; ``ab`` (rows, n), in Fortran order."""

    ab: FloatArray

    @classmethod
    def zeros(cls, n: int, rows: int) -> "Band":
        """An empty matrix whose blocks of up to ``rows - 1`` columns can be added to."""
        return cls(np.zeros((rows, n), order="F"))

    @property
    def flat(self) -> FloatArray:
        """The storage, entry (i, j) at ``i + j * stride``."""
        return self.ab.ravel(order="K")

    @property
    def stride(self) -> int:
        """See :attr:`flat`."""
        return len(self.ab) - 1

    def block(self, rows: slice, columns: slice) -> FloatArray:
        """View of a dense block; above the diagonal and below the band it shows other entries of the band."""
        step = self.ab.itemsize
        shape = rows.stop - rows.start, columns.stop - columns.start
        offset = step * (rows.start + columns.start * self.stride)
        return np.ndarray(shape, np.float64, self.flat, offset, (step, step * self.stride))

    def add_square(self, frames: IntArray, square: FloatArray) -> None:
        """Add a block over ascending frames (s,), (6 s, 6 s), zero above its diagonal.

        No single track is longer than the band: entries beyond it are zero, and have no place of their own.
        """
        if frames[-1] - frames[0] + 1 == len(frames):
            self.add_lower(POSE * int(frames[0]), square)
            return
        rows, columns = np.tril_indices(len(square))
        index = (POSE * frames[:, None] + np.arange(POSE)).ravel()
        i, j = index[rows], index[columns]
        near = i - j < len(self.ab)
        self.add_entries(i[near], j[near], square[rows[near], columns[near]])

    def add_lower(self, start: int, block: FloatArray) -> None:
        """Add a square block on the diagonal at ``start``; it must be zero above its diagonal.

        With fewer columns than rows in storage no entry of the view is stored twice, and the zeros above the
        diagonal fall on other columns' entries, which they leave alone.
        """
        stop = start + len(block)
        view = self.block(slice(start, stop), slice(start, stop))
        np.add(view, block, out=view)

    def add_entries(self, rows: IntArray, columns: IntArray, values: FloatArray) -> None:
        """Add to entries of the lower triangle, each given once."""
        self.flat[rows + columns * self.stride] += values

    def add_diagonal(self, values: FloatArray) -> None:
        """Add (n,) values to the diagonal."""
        self.ab[0] += values

    def cholesky(self, half_bandwidth: int, least_pivot: FloatArray | float = 0.0) -> "Band":
        """The factor L of L L^T, of ``half_bandwidth + 1`` stored rows.

        Raises:
            NotPositiveDefiniteError: There is none, or a squared pivot is below (n,) ``least_pivot``.
        """
        compact = self.ab[: half_bandwidth + 1].copy(order="F")
        factor, info = lapack.dpbtrf(compact, lower=1, overwrite_ab=1)
        if info > 0:
            raise NotPositiveDefiniteError(info - 1)
        small = ~(factor[0] ** 2 > least_pivot)  # true of NaN as well
        if np.any(small):
            raise NotPositiveDefiniteError(int(np.argmax(small)))
        return Band(factor)

    def solve(self, right: FloatArray) -> FloatArray:
        """x of L L^T x = right, self being L; right (n,) or (n, k)."""
        if right.size == 0:
            return right
        x, _ = lapack.dpbtrs(self.ab, right, lower=1)
        return np.asarray(x).reshape(right.shape)

    def inverse_diagonal_blocks(self) -> FloatArray:
        """(n / 6, 6, 6) diagonal blocks of (L L^T)^-1, self being L.

        In blocks no smaller than the bandwidth, L is block bidiagonal with diagonal D_i and C_i below it, and
        the inverse's diagonal blocks follow backwards: S_i = D_i^-T (1 + C_i^T S_i+1 C_i) D_i^-1.
        """
        n = self.ab.shape[1]
        size = POSE * max(-(-self.stride // POSE), 16)
        blocks: list[FloatArray] = []
        following: FloatArray | None = None
        for start in reversed(range(0, n, size)):
            own = slice(start, min(start + size, n))
            middle = np.eye(own.stop - start)
            if following is not None:
                below = self._below(own, len(following))
                middle += below.T @ following @ below
            lower = self.block(own, own)
            # beyond the band the view shows other entries
            inverse, _ = lapack.dtrtri(np.tril(lower) - np.tril(lower, -self.stride - 1), lower=1)
            following = inverse.T @ middle @ inverse
            poses = following.reshape(len(following) // POSE, POSE, -1, POSE)
            blocks.append(np.einsum("iaib->iab", poses)[::-1])
        return np.concatenate(blocks)[::-1] if blocks else np.zeros((0, POSE, POSE))

    def _below(self, columns: slice, count: int) -> FloatArray:
        """Block under the diagonal block: an upper triangle, the band's lower corner."""
        block = self.block(slice(columns.stop, columns.stop + count), columns)
        return np.triu(block, columns.stop - columns.start - self.stride)

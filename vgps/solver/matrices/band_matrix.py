"""A symmetric band matrix over poses, assembled in dense blocks and factored by LAPACK.

Storage is LAPACK's lower band, ``ab[i - j, j] = A[i, j]``, in Fortran order: entry (i, j) lies at
``i + j * (rows - 1)``, so that a dense block of the matrix is a strided view of the band.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from vgps.model import FloatArray, IntArray
from vgps.solver.matrices.dense_products import subtract_square

POSE_DIM = 6  # tangent of a pose


class NotPositiveDefiniteError(ArithmeticError):
    """The matrix has no Cholesky factor.

    Args:
        column: The first column whose pivot is not positive.
    """

    def __init__(self, column: int) -> None:
        self.column = column
        super().__init__(f"the pivot of column {column} is not positive")


def entries_in_band(
    frames: IntArray, square: FloatArray, stored: int
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return rows, columns and values of a block (6 s, 6 s) over frames (s,), on and below the diagonal.

    Entries beyond the stored rows of a band are zero, since no track is longer than the band, and are left
    out.
    """
    rows, columns = np.tril_indices(len(square))
    index = (POSE_DIM * frames[:, None] + np.arange(POSE_DIM)).ravel()
    i, j = index[rows], index[columns]
    inside = i - j < stored
    return i[inside], j[inside], square[rows[inside], columns[inside]]


@dataclass(frozen=True)
class BandMatrix:
    """The lower triangle of a symmetric (n, n) matrix, or its Cholesky factor.

    Attributes:
        ab: (rows, n) in Fortran order.
    """

    ab: FloatArray

    @classmethod
    def zeros(cls, n: int, rows: int) -> "BandMatrix":
        """Return a zero matrix to which blocks of up to ``rows - 1`` columns can be added."""
        return cls(np.zeros((rows, n), order="F"))

    @property
    def flat(self) -> FloatArray:
        """The storage, entry (i, j) at ``i + j * stride``."""
        return self.ab.ravel(order="K")

    @property
    def stride(self) -> int:
        """Step in :attr:`flat` from one column to the next."""
        return len(self.ab) - 1

    def block(self, rows: slice, columns: slice) -> FloatArray:
        """Return a view of a dense block; outside the stored band it contains unrelated entries."""
        step = self.ab.itemsize
        shape = rows.stop - rows.start, columns.stop - columns.start
        offset = step * (rows.start + columns.start * self.stride)
        return np.ndarray(shape, np.float64, self.flat, offset, (step, step * self.stride))

    def subtract_square(self, frames: IntArray, Z: FloatArray) -> None:
        """Subtract Z^T Z, for Z (k, 6 s), over ascending frames (s,)."""
        if frames[-1] - frames[0] + 1 == len(frames):
            columns = slice(POSE_DIM * int(frames[0]), POSE_DIM * (int(frames[-1]) + 1))
            subtract_square(Z, self.block(columns, columns))
        else:
            self.add_entries(*entries_in_band(frames, -(Z.T @ Z), len(self.ab)))

    def add_lower(self, start: int, block: FloatArray) -> None:
        """Add a square block on the diagonal at ``start``, zero above its own diagonal.

        With fewer columns than stored rows no entry occurs twice in the view, and the zeros above the
        diagonal leave the unrelated entries that they fall on unchanged.
        """
        stop = start + len(block)
        view = self.block(slice(start, stop), slice(start, stop))
        np.add(view, block, out=view)

    def add_entries(self, rows: IntArray, columns: IntArray, values: FloatArray) -> None:
        """Add to entries of the lower triangle, each of which is given once."""
        self.flat[rows + columns * self.stride] += values

    def add_diagonal(self, values: FloatArray) -> None:
        """Add (n,) values to the diagonal."""
        self.ab[0] += values

    def cholesky(self, half_bandwidth: int, min_pivot: FloatArray | float = 0.0) -> "BandMatrix":
        """Return the factor L of A = L L^T, with ``half_bandwidth + 1`` stored rows.

        Raises:
            NotPositiveDefiniteError: There is none, or a squared pivot is not above ``min_pivot``, a number
                or (n,).
        """
        return factorised(self.ab[: half_bandwidth + 1].copy(order="F"), min_pivot)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve ``L L^T x = right``, where L is this factor; ``right`` is (n,) or (n, k)."""
        if right.size == 0:
            return right
        x, _ = lapack.dpbtrs(self.ab, right, lower=1)
        return np.asarray(x).reshape(right.shape)

    def inverse_diagonal_blocks(self) -> FloatArray:
        """Return the diagonal blocks (n / 6, 6, 6) of (L L^T)^-1, where L is this factor.

        In blocks no smaller than the bandwidth, L is block bidiagonal with D_i on and C_i below the diagonal,
        and the diagonal blocks of the inverse follow from the last to the first:
        ``S_i = D_i^-T (1 + C_i^T S_i+1 C_i) D_i^-1``.
        """
        n = self.ab.shape[1]
        size = POSE_DIM * max(-(-self.stride // POSE_DIM), 16)
        blocks: list[FloatArray] = []
        following: FloatArray | None = None
        for start in reversed(range(0, n, size)):
            span = slice(start, min(start + size, n))
            middle = np.eye(span.stop - start)
            if following is not None:
                below = self._below(span, len(following))
                middle += below.T @ following @ below
            lower = self.block(span, span)
            # outside the band the view contains unrelated entries
            inverse, _ = lapack.dtrtri(np.tril(lower) - np.tril(lower, -self.stride - 1), lower=1)
            following = inverse.T @ middle @ inverse
            poses = following.reshape(len(following) // POSE_DIM, POSE_DIM, -1, POSE_DIM)
            blocks.append(np.einsum("iaib->iab", poses)[::-1])
        return np.concatenate(blocks)[::-1] if blocks else np.zeros((0, POSE_DIM, POSE_DIM))

    def _below(self, columns: slice, count: int) -> FloatArray:
        """Return the block below a diagonal block: an upper triangle, the lower corner of the band."""
        block = self.block(slice(columns.stop, columns.stop + count), columns)
        return np.triu(block, columns.stop - columns.start - self.stride)


def factorised(ab: FloatArray, min_pivot: FloatArray | float = 0.0) -> BandMatrix:
    """Return the factor of a band (rows, n), written over it.

    Raises:
        NotPositiveDefiniteError: As :meth:`BandMatrix.cholesky`.
    """
    factor, info = lapack.dpbtrf(ab, lower=1, overwrite_ab=1)
    if info > 0:
        raise NotPositiveDefiniteError(info - 1)
    small = ~(factor[0] ** 2 > min_pivot)  # true of NaN as well
    if np.any(small):
        raise NotPositiveDefiniteError(int(np.argmax(small)))
    return BandMatrix(factor)

"""A symmetric matrix over frames in order of time: assembled in blocks, factored and inverted as a band.

Storage is LAPACK's lower band, ``ab[i - j, j] = A[i, j]``, in Fortran order: entry (i, j) lies at
``i + j * (rows - 1)``, so a dense block of the matrix is a strided view of the band.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import as_strided
from scipy.linalg import blas, lapack

from vgps.model import FloatArray, IntArray

POSE = 6  # columns of a pose


class NotPositiveDefiniteError(ArithmeticError):
    """The matrix has no Cholesky factor."""


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
        return as_strided(
            self.flat[rows.start + columns.start * self.stride :],
            (rows.stop - rows.start, columns.stop - columns.start),
            (step, step * self.stride),
        )

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

    def cholesky(self, half_bandwidth: int) -> "Band":
        """The factor L of L L^T, of ``half_bandwidth + 1`` stored rows.

        Raises:
            NotPositiveDefiniteError: There is none.
        """
        compact = self.ab[: half_bandwidth + 1].copy(order="F")
        factor, info = lapack.dpbtrf(compact, lower=1, overwrite_ab=1)
        if info != 0 or not np.all(np.isfinite(factor[0])):
            raise NotPositiveDefiniteError(f"column {info}")
        return Band(factor)

    def solve(self, right: FloatArray) -> FloatArray:
        """(n,) x of L L^T x = right, self being L."""
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
            inverse, _ = lapack.dtrtri(np.tril(self.block(own, own)), lower=1)
            following = inverse.T @ middle @ inverse
            poses = following.reshape(len(following) // POSE, POSE, -1, POSE)
            blocks.append(np.einsum("iaib->iab", poses)[::-1])
        return np.concatenate(blocks)[::-1] if blocks else np.zeros((0, POSE, POSE))

    def _below(self, columns: slice, count: int) -> FloatArray:
        """Block under the diagonal block: an upper triangle, the band's lower corner."""
        block = self.block(slice(columns.stop, columns.stop + count), columns)
        return np.triu(block, columns.stop - columns.start - self.stride)


@dataclass(frozen=True)
class Group:
    """Landmarks seen in nearly the same frames, eliminated together as one dense block.

    Attributes:
        frames: (s,) free frames in which any of them is seen, ascending.
        landmarks: Their number.
        start: Where the block begins in the buffer of all blocks, each (3 landmarks, 6 s) in C order.
    """

    frames: IntArray
    landmarks: int
    start: int

    @cached_property
    def width(self) -> int:
        """Columns of the block."""
        return POSE * len(self.frames)

    @cached_property
    def contiguous(self) -> bool:
        """Whether no frame between its first and its last is missing."""
        return int(self.frames[-1] - self.frames[0]) + 1 == len(self.frames)

    @property
    def size(self) -> int:
        """Entries of the block."""
        return 3 * self.landmarks * self.width

    def subtract_square(self, buffer: FloatArray, band: Band) -> None:
        """Subtract Z^T Z of its block Z from the matrix."""
        Z = buffer[self.start : self.start + self.size].reshape(3 * self.landmarks, self.width)
        square = blas.dsyrk(-1.0, Z.T, lower=1)
        if self.contiguous:
            band.add_lower(POSE * int(self.frames[0]), square)
            return
        rows, columns = np.tril_indices(self.width)
        index = (POSE * self.frames[:, None] + np.arange(POSE)).ravel()
        band.add_entries(index[rows], index[columns], square[rows, columns])


@dataclass(frozen=True)
class Grouping:
    """How the landmarks are eliminated.

    Attributes:
        groups: The dense blocks.
        entry: (N, 3) where in the buffer each observation's three runs of six entries begin.
        size: Entries of the buffer.
        span: Frames from the first to the last of the longest track.
    """

    groups: tuple[Group, ...]
    entry: IntArray
    size: int
    span: int

    @property
    def flops(self) -> float:
        """Multiplications and additions of all blocks' squares."""
        return float(sum(group.size * group.width for group in self.groups))


def group_landmarks(frame: IntArray, landmark: IntArray) -> Grouping:
    """Gather landmarks of like first frame and like length.

    Lengths are binned by powers of the square root of two and first frames by half a length, so a block spans
    at most about twice its tracks' length.

    Args:
        frame: (N,) free frame of each observation.
        landmark: (N,) its landmark.

    Raises:
        ValueError: A landmark is seen twice in one frame.
    """
    if not len(frame):
        return Grouping((), np.zeros((0, 3), dtype=np.int64), 0, 0)
    _, row = np.unique(landmark, return_inverse=True)
    first, last = np.full(row.max() + 1, frame.max()), np.zeros(row.max() + 1, dtype=np.int64)
    np.minimum.at(first, row, frame)
    np.maximum.at(last, row, frame)
    bin_of_length = np.ceil(2.0 * np.log2(np.maximum(last - first + 1, 4))).astype(np.int64)
    bucket = first // (2.0 ** (0.5 * bin_of_length) / 2.0).astype(np.int64)
    _, group = np.unique(bin_of_length * (frame.max() + 1) + bucket, return_inverse=True)
    groups, entry = _lay_out(frame, row, group)
    return Grouping(groups, entry, sum(g.size for g in groups), int(np.max(last - first)) + 1)


def _lay_out(frame: IntArray, row: IntArray, group: IntArray) -> tuple[tuple[Group, ...], IntArray]:
    count = int(group.max()) + 1
    number = np.bincount(group, minlength=count)  # of landmarks in each group
    by_group = np.argsort(group, kind="stable")
    place = np.empty_like(row[: len(group)])  # of a landmark in its group
    place[by_group] = np.arange(len(group)) - np.repeat(np.cumsum(number) - number, number)
    pairs, column = np.unique(group[row] * (frame.max() + 1) + frame, return_inverse=True)
    first_pair = np.searchsorted(pairs, np.arange(count + 1) * (frame.max() + 1))
    groups, start = [], 0
    for g in range(count):
        frames = pairs[first_pair[g] : first_pair[g + 1]] - g * (frame.max() + 1)
        groups.append(Group(frames, int(number[g]), start))
        start += groups[-1].size
    width = np.array([g.width for g in groups])[group[row]]
    begin = np.array([g.start for g in groups])[group[row]] + POSE * (column - first_pair[group[row]])
    entry = begin[:, None] + (3 * place[row, None] + np.arange(3)) * width[:, None]
    if len(np.unique(entry[:, 0])) != len(entry):
        raise ValueError("a landmark is seen twice in one frame")
    return tuple(groups), entry

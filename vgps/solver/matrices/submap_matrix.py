"""A band matrix over many frames, cut into submaps that are on disk and eliminated one after the other.

The frames of a submap that tracks couple with the one before it are its separator. A submap eliminates its
columns to the Schur complement on the separator of the next one, which goes on with it: with the columns of a
submap A and the separator's rows B below them, ``A = L L^T``, ``M = B L^-T``, and the next submap loses
``M M^T``. This is Cholesky's factorisation of the whole matrix, up to rounding, in memory for one submap.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import blas, lapack

from vgps.model import FloatArray, IntArray
from vgps.solver.disk_arrays import DiskArrays
from vgps.solver.matrices.band_matrix import (
    POSE_DIM,
    BandMatrix,
    NotPositiveDefiniteError,
    entries_in_band,
    factorised,
)


@dataclass(frozen=True)
class SubmapLayout:
    """Where a matrix is cut.

    Attributes:
        first: (S + 1,) first place of each submap, then the number of places.
        separator: (S,) places of each submap that are coupled with an earlier one; 0 for the first.
    """

    first: IntArray
    separator: IntArray

    @property
    def columns(self) -> list[slice]:
        """Columns of the matrix in each submap."""
        ends = (POSE_DIM * self.first).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]


def cut_into_submaps(places: int, last: IntArray, frames: int) -> SubmapLayout:
    """Cut between submaps of about so many frames, where the fewest frames are coupled across.

    Args:
        places: Number of places.
        last: (places,) last place that each place is coupled with, itself included.
        frames: Places of a submap.

    Returns:
        The submaps; a single one where more than half of a submap would be separator.
    """
    reach = np.append(0, np.maximum.accumulate(last)[:-1] + 1)  # of all places before each
    width = np.maximum(reach - np.arange(places), 0)
    first = [0]
    while places - first[-1] > 2 * frames and 2 * int(width.max()) <= frames:
        window = np.arange(first[-1] + frames, first[-1] + frames + frames // 4 + 1)
        first.append(int(window[np.argmin(width[window])]))
    return SubmapLayout(np.array([*first, places]), width[first])


@dataclass(frozen=True)
class SubmapMatrix:
    """The lower triangle of a symmetric matrix.

    Attributes:
        layout: Where it is cut.
        parts: Each submap's columns, with rows below its own as far as the band reaches.
        arrays: Where they are stored.
    """

    layout: SubmapLayout
    parts: tuple[BandMatrix, ...]
    arrays: DiskArrays

    @classmethod
    def zeros(cls, layout: SubmapLayout, rows: int) -> "SubmapMatrix":
        """Return a zero matrix with so many stored rows of the band."""
        arrays = DiskArrays()
        sizes = [span.stop - span.start for span in layout.columns]
        return cls(layout, tuple(BandMatrix(arrays.empty((rows, size))) for size in sizes), arrays)

    def subtract_square(self, frames: IntArray, Z: FloatArray) -> None:
        """Subtract Z^T Z, for Z (k, 6 s), over ascending frames (s,)."""
        if frames[-1] - frames[0] + 1 == len(frames):
            self._add_lower(POSE_DIM * int(frames[0]), -np.tril(Z.T @ Z))
        else:
            self.add_entries(*entries_in_band(frames, -(Z.T @ Z), len(self.parts[0].ab)))

    def _add_lower(self, start: int, block: FloatArray) -> None:
        """Add a square block on the diagonal at ``start``, zero above its own diagonal."""
        for part, span in self._parts_of(start, start + len(block)):
            first, end = max(start, span.start), min(start + len(block), span.stop)
            rows = slice(first - span.start, start + len(block) - span.start)
            view = part.block(rows, slice(first - span.start, end - span.start))
            np.add(view, block[first - start :, first - start : end - start], out=view)
        self.arrays.passed(block.nbytes)

    def _parts_of(self, start: int, stop: int) -> Iterator[tuple[BandMatrix, slice]]:
        """Yield the submaps with these columns, and all columns of each."""
        ends = POSE_DIM * self.layout.first
        low, high = np.searchsorted(ends, (start, stop - 1), side="right").tolist()
        for number in range(low - 1, high):
            yield self.parts[number], self.layout.columns[number]

    def add_entries(self, rows: IntArray, columns: IntArray, values: FloatArray) -> None:
        """Add to entries of the lower triangle, each of which is given once."""
        number = np.searchsorted(POSE_DIM * self.layout.first, columns, side="right") - 1
        order = np.argsort(number, kind="stable")
        which, begins = np.unique(number[order], return_index=True)
        for one, chosen in zip(which.tolist(), np.split(order, begins[1:]), strict=True):
            start = self.layout.columns[one].start
            self.parts[one].add_entries(rows[chosen] - start, columns[chosen] - start, values[chosen])
            self.arrays.passed(self.parts[one].ab.nbytes)

    def add_diagonal(self, values: FloatArray) -> None:
        """Add (n,) values to the diagonal."""
        for part, span in zip(self.parts, self.layout.columns, strict=True):
            part.add_diagonal(values[span])
            self.arrays.passed(part.ab.nbytes)

    def cholesky(self, half_bandwidth: int, min_pivot: FloatArray | float = 0.0) -> "SubmapFactor":
        """Return the factor, submap by submap.

        Raises:
            NotPositiveDefiniteError: As :meth:`BandMatrix.cholesky`.
        """
        arrays, factors, below = DiskArrays(), [], []
        complement: FloatArray = np.zeros((0, 0))
        least = np.broadcast_to(min_pivot, int(POSE_DIM * self.layout.first[-1]))
        separators = [*(POSE_DIM * self.layout.separator[1:]).tolist(), 0]
        for part, span, size in zip(self.parts, self.layout.columns, separators, strict=True):
            here = BandMatrix(np.array(part.ab[: half_bandwidth + 1], order="F"))
            here.add_lower(0, -complement)
            coupling = _coupling(here, size)
            try:
                factor = factorised(here.ab, least[span])
            except NotPositiveDefiniteError as error:
                raise NotPositiveDefiniteError(span.start + error.column) from None
            M = _divided(coupling, factor)
            complement = blas.dsyrk(1.0, M, lower=1) if size else np.zeros((0, 0))
            stored = arrays.empty(factor.ab.shape)
            stored[...] = factor.ab
            factors.append(BandMatrix(stored))
            below.append(arrays.kept(M))
            arrays.passed(stored.nbytes)
            self.arrays.passed(part.ab.nbytes)
        return SubmapFactor(self.layout, tuple(factors), tuple(below), arrays)


def _coupling(part: BandMatrix, size: int) -> FloatArray:
    """Return the rows (size, width) of a separator below a submap, over the submap's last columns."""
    n = part.ab.shape[1]
    width = min(part.stride, n)
    return np.triu(part.block(slice(n, n + size), slice(n - width, n)), width - part.stride)


def _divided(coupling: FloatArray, factor: BandMatrix) -> FloatArray:
    """Return ``B L^-T`` for B over the last columns of a submap."""
    n, width = factor.ab.shape[1], coupling.shape[1]
    if not len(coupling):
        return coupling
    corner = np.tril(factor.block(slice(n - width, n), slice(n - width, n)))
    return np.asarray(blas.dtrsm(1.0, corner, coupling, side=1, lower=1, trans_a=1))


@dataclass(frozen=True)
class SubmapFactor:
    """The Cholesky factor of a :class:`SubmapMatrix`.

    Attributes:
        layout: Where it is cut.
        parts: Factor of each submap.
        below: Of each submap the rows of the next one's separator, over its own last columns.
        arrays: Where they are stored.
    """

    layout: SubmapLayout
    parts: tuple[BandMatrix, ...]
    below: tuple[FloatArray, ...]
    arrays: DiskArrays

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve ``L L^T x = right``; ``right`` is (n,) or (n, k)."""
        x = np.array(right, dtype=np.float64).reshape(len(right), -1)
        if x.size == 0:
            return right
        spans = self.layout.columns
        for part, below, span in zip(self.parts, self.below, spans, strict=True):
            x[span], _ = lapack.dtbtrs(part.ab, x[span], uplo="L")
            size, width = below.shape
            x[span.stop : span.stop + size] -= below @ x[span.stop - width : span.stop]
            self.arrays.passed(part.ab.nbytes)
        for part, below, span in zip(self.parts[::-1], self.below[::-1], spans[::-1], strict=True):
            size, width = below.shape
            x[span.stop - width : span.stop] -= below.T @ x[span.stop : span.stop + size]
            x[span], _ = lapack.dtbtrs(part.ab, x[span], uplo="L", trans="T")
            self.arrays.passed(part.ab.nbytes)
        return x.reshape(right.shape)

    def inverse_diagonal_blocks(self) -> FloatArray:
        """Return the diagonal blocks (n / 6, 6, 6) of the inverse.

        A submap needs the inverse over the next one's separator S: with E the columns of the identity at its
        own last columns, its inverse gains ``L^-T E M^T S M E^T L^-1``.
        """
        blocks: list[FloatArray] = []
        separator: FloatArray = np.zeros((0, 0))
        for part, below, count in zip(
            self.parts[::-1], self.below[::-1], (POSE_DIM * self.layout.separator[::-1]).tolist(), strict=True
        ):
            n, width = part.ab.shape[1], below.shape[1]
            tail = np.zeros((n, len(below)))
            tail[n - width :] = below.T
            moved, _ = lapack.dtbtrs(part.ab, tail, uplo="L", trans="T") if tail.size else (tail, 0)
            by_pose = moved.reshape(n // POSE_DIM, POSE_DIM, -1)
            own = part.inverse_diagonal_blocks() + by_pose @ separator @ by_pose.transpose(0, 2, 1)
            blocks.append(own)
            head = np.eye(n, count)
            first = part.solve(head)[:count] if count else np.zeros((0, 0))
            separator = first + moved[:count] @ separator @ moved[:count].T
            self.arrays.passed(part.ab.nbytes)
        return np.concatenate(blocks[::-1])

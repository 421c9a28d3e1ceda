"""Fill-reducing order and storage of a block-sparse symmetric matrix over frames."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.matrices.dense_products import BlockOfSquare, block_of_square

BLOCK_FRAMES = 16  # fastest of 8, 12, 16 and 24 on two and four laps around a city block
_BLOCK_COLUMNS = POSE_DIM * BLOCK_FRAMES


class Contribution(NamedTuple):
    """What an earlier column of blocks subtracts from a column: products of its rows with some of them.

    Attributes:
        earlier: The earlier column.
        first: Where in the earlier column the rows of the column's own block begin.
        runs: Rows of the earlier column, from these on, and where their products go in the column.
    """

    earlier: int
    first: int
    runs: tuple[tuple[slice, slice], ...]


@dataclass(frozen=True, kw_only=True)
class BlockLayout:
    """Elimination order of the blocks, which of them have entries in the factor, and where they are stored.

    Block (i, j) is stored if j is eliminated before i or equals i. Storage goes column by column in order of
    elimination, the diagonal block first, then the others in order of elimination, so that the blocks below
    the diagonal of a column form one C-ordered panel.

    Attributes:
        columns: Number n of columns of the matrix.
        order: (T,) blocks in order of elimination.
        rank: (T,) position of each block in ``order``.
        below: For each block the nonzero blocks below the diagonal of its column, in order of elimination.
        start: (T, T) index at which each block is stored; -1 if it is zero or stored as its transpose.
        size: Number of stored entries.
        pieces: Those of each set of frames that was asked for, by its bytes.
    """

    columns: int
    order: IntArray
    rank: IntArray
    below: tuple[IntArray, ...]
    start: IntArray
    size: int
    pieces: dict[bytes, tuple[BlockOfSquare, ...]] = field(default_factory=dict, compare=False, repr=False)

    def pieces_of(self, frames: IntArray) -> tuple[BlockOfSquare, ...]:
        """Return the parts of a square over ascending frames (s,) that each lie in one block."""
        key = frames.tobytes()
        if key not in self.pieces:
            self.pieces[key] = tuple(self._cut(frames))
        return self.pieces[key]

    def _cut(self, frames: IntArray) -> Iterator[BlockOfSquare]:
        """Yield the parts: runs of successive frames within a block against those before and themselves."""
        begin = np.flatnonzero((np.diff(frames, prepend=-2) != 1) | (frames % BLOCK_FRAMES == 0)).tolist()
        runs = [slice(POSE_DIM * a, POSE_DIM * b) for a, b in pairwise([*begin, len(frames)])]
        at = [divmod(frame, BLOCK_FRAMES) for frame in frames[begin].tolist()]
        for i, (row, r) in enumerate(at):
            for j, (column, c) in enumerate(at[: i + 1]):
                if self.rank[row] >= self.rank[column]:
                    start, width = int(self.start[row, column]), self.width(column)
                    yield block_of_square(runs[i], runs[j], start + POSE_DIM * (r * width + c), width)
                else:
                    start, width = int(self.start[column, row]), self.width(row)
                    yield block_of_square(runs[j], runs[i], start + POSE_DIM * (c * width + r), width)

    def span(self, block: int) -> slice:
        """Return the columns of the matrix that a block covers."""
        first = _BLOCK_COLUMNS * block
        return slice(first, min(first + _BLOCK_COLUMNS, self.columns))

    def width(self, block: int) -> int:
        """Return the number of columns that a block covers."""
        return _width(block, self.columns)

    def rows_below(self, block: int) -> IntArray:
        """Return the rows of the matrix in the panel below a diagonal block."""
        spans = [np.arange(self.span(i).start, self.span(i).stop) for i in self.below[block].tolist()]
        return np.concatenate(spans) if spans else np.zeros(0, dtype=np.int64)

    def column(self, block: int, flat: FloatArray) -> FloatArray:
        """Return a view of a column of blocks, the diagonal block first, among the stored entries."""
        width, at = self.width(block), int(self.start[block, block])
        rows = width + sum(self.width(i) for i in self.below[block].tolist())
        return flat[at : at + rows * width].reshape(rows, width)

    @cached_property
    def contributions(self) -> tuple[tuple[Contribution, ...], ...]:
        """For each block what the columns eliminated before it subtract from its column, in their order."""
        found: list[list[Contribution]] = [[] for _ in self.below]
        rows = [self._rows_of(column) for column in range(len(self.below))]
        for earlier in self.order.tolist():
            for block in self.below[earlier].tolist():
                runs = _runs(rows[earlier], rows[block])
                found[block].append(Contribution(earlier, rows[earlier][block].start, runs))
        return tuple(map(tuple, found))

    def _rows_of(self, column: int) -> dict[int, slice]:
        """Return the rows of each block of a column within it, in order of elimination."""
        blocks = [column, *self.below[column].tolist()]
        ends = list(accumulate(self.width(i) for i in blocks))
        return {i: slice(begin, end) for i, begin, end in zip(blocks, [0, *ends], ends, strict=False)}

    @property
    def flops(self) -> float:
        """Multiplications and additions of one factorisation."""
        total = 0.0
        for block in range(len(self.order)):
            w, m = self.width(block), sum(self.width(i) for i in self.below[block].tolist())
            total += w**3 / 3 + w * w * m + w * m * m
        return total


def layout_blocks(
    frames: int, cliques: Iterable[IntArray], stages: Sequence[IntArray] | None = None
) -> BlockLayout:
    """Order the blocks by minimum degree (Tinney and Walker 1967) and lay out the factor.

    Args:
        frames: Number of frames of the matrix.
        cliques: Sets of frames; all frames of a set are coupled with each other.
        stages: Blocks that are eliminated before those of later stages; None for all in one.
    """
    blocks = -(-frames // BLOCK_FRAMES)
    order, below = _minimum_degree(blocks, cliques, [np.arange(blocks)] if stages is None else stages)
    columns, at = POSE_DIM * frames, 0
    start = np.full((len(order), len(order)), -1, dtype=np.int64)
    for block in order.tolist():
        for row in (block, *below[block].tolist()):
            start[row, block] = at
            at += _width(row, columns) * _width(block, columns)
    rank = np.argsort(order)
    return BlockLayout(columns=columns, order=order, rank=rank, below=below, start=start, size=at)


def _runs(source: dict[int, slice], target: dict[int, slice]) -> tuple[tuple[slice, slice], ...]:
    """Return rows of blocks that two columns have in common, joined where they follow each other in both."""
    runs: list[tuple[slice, slice]] = []
    for rows, at in ((source[block], target[block]) for block in source if block in target):
        if runs and (runs[-1][0].stop, runs[-1][1].stop) == (rows.start, at.start):
            runs[-1] = slice(runs[-1][0].start, rows.stop), slice(runs[-1][1].start, at.stop)
        else:
            runs.append((rows, at))
    return tuple(runs)


def blocks_of(cliques: Iterable[IntArray]) -> set[frozenset[int]]:
    """Return the sets of blocks that sets of frames lie in."""
    return {frozenset(np.unique(frames // BLOCK_FRAMES).tolist()) for frames in cliques}


def _minimum_degree(
    blocks: int, cliques: Iterable[IntArray], stages: Sequence[IntArray]
) -> tuple[IntArray, tuple[IntArray, ...]]:
    """Return the order of elimination, and for each block the later blocks that its column couples with."""
    neighbours: list[set[int]] = [set() for _ in range(blocks)]
    for clique in blocks_of(cliques):
        for block in clique:
            neighbours[block] |= clique - {block}
    order: list[int] = []
    for stage in stages:
        left = set(stage.tolist())
        while left:
            block = min(left, key=lambda i: (len(neighbours[i]), i))
            left.remove(block)
            order.append(block)
            for other in neighbours[block]:
                neighbours[other] |= neighbours[block]
                neighbours[other] -= {other, block}
    rank = np.argsort(np.array(order, np.int64))
    below = [np.array(sorted(later, key=lambda i: rank[i]), np.int64) for later in neighbours]
    return np.array(order, np.int64), tuple(below)


def _width(block: int, columns: int) -> int:
    return min(_BLOCK_COLUMNS, columns - _BLOCK_COLUMNS * block)

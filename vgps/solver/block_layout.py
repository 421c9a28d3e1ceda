"""Which tiles of a symmetric matrix over frames have entries, and in which order they are eliminated."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vgps.model import IntArray
from vgps.solver.band_matrix import POSE

TILE = 16  # frames; of 8, 12, 16 and 24 the quickest on two and four laps of a block


@dataclass(frozen=True)
class TileLayout:
    """Which tiles have entries, those of the factor included, and where they are stored.

    A tile (i, j) is stored where j is eliminated before i or is i: column by column, the diagonal tile
    first, the others in order of elimination, so that a column is one C-ordered panel.

    Attributes:
        columns: n, of the matrix.
        order: (T,) tiles in order of elimination; ``place`` (T,) when each is eliminated.
        below: For each tile those of its column below the diagonal, in order of elimination.
        start: (T, T) where each tile is stored; -1 where it is empty or stored as its transpose.
        size: Entries stored.
    """

    columns: int
    order: IntArray
    place: IntArray
    below: tuple[IntArray, ...]
    start: IntArray
    size: int

    def span(self, tile: int) -> slice:
        """Columns of the matrix in a tile."""
        return slice(POSE * TILE * tile, min(POSE * TILE * (tile + 1), self.columns))

    def width(self, tile: int) -> int:
        """Their number."""
        return min(POSE * TILE, self.columns - POSE * TILE * tile)

    def rows_below(self, tile: int) -> IntArray:
        """Rows of the matrix in a column's panel, without the diagonal tile."""
        spans = [np.arange(self.span(i).start, self.span(i).stop) for i in self.below[tile].tolist()]
        return np.concatenate(spans) if spans else np.zeros(0, dtype=np.int64)

    @property
    def flops(self) -> float:
        """Multiplications and additions that a factorisation takes."""
        total = 0.0
        for tile in range(len(self.order)):
            w, m = self.width(tile), sum(self.width(i) for i in self.below[tile].tolist())
            total += w**3 / 3 + w * w * m + w * m * m
        return total


def tile_layout(frames: int, together: Iterable[IntArray]) -> TileLayout:
    """Order and storage for a matrix over frames of which some sets hang together, each with all of its own.

    The order is of least degree (Tinney and Walker 1967), on tiles.

    Args:
        frames: Of the matrix.
        together: Sets of frames.
    """
    tiles = -(-frames // TILE)
    neighbours: list[set[int]] = [set() for _ in range(tiles)]
    for clique in {frozenset(np.unique(members // TILE).tolist()) for members in together}:
        for tile in clique:
            neighbours[tile] |= clique - {tile}
    place, found = np.zeros(tiles, dtype=np.int64), []
    left = set(range(tiles))
    for when in range(tiles):
        tile = min(left, key=lambda i: (len(neighbours[i]), i))
        left.remove(tile)
        place[tile] = when
        found.append((tile, neighbours[tile]))
        for other in neighbours[tile]:
            neighbours[other] |= neighbours[tile]
            neighbours[other] -= {other, tile}
    below = {tile: np.array(sorted(later, key=lambda i: place[i]), np.int64) for tile, later in found}
    order = np.argsort(place)
    return _stored(TileLayout(POSE * frames, order, place, tuple(below[i] for i in range(tiles)), place, 0))


def _stored(layout: TileLayout) -> TileLayout:
    """With the places of the tiles in storage."""
    tiles, at = len(layout.order), 0
    start = np.full((tiles, tiles), -1, dtype=np.int64)
    for tile in layout.order.tolist():
        for row in (tile, *layout.below[tile].tolist()):
            start[row, tile] = at
            at += layout.width(row) * layout.width(tile)
    return TileLayout(layout.columns, layout.order, layout.place, layout.below, start, at)

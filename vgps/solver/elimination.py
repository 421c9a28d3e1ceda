"""How the poses' matrix is stored and filled: as a band, or in tiles where places are seen again.

Landmarks that begin near each other and are tracked about equally long are eliminated together; in tiles,
those that are seen in the same ones.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.band_matrix import POSE, Band
from vgps.solver.block_layout import TILE, TileLayout, tile_layout
from vgps.solver.block_matrix import Tiles
from vgps.solver.landmark_groups import Chunk, chunks_of
from vgps.solver.problem import BundleProblem

__all__ = ["Chunk", "Matrix", "Structure", "structure_of"]

Matrix = Band | Tiles

_QUICK = 5e9  # operations of a band below which tiles are not looked into
_DEARER = 4.0  # times as long as in a band an operation in tiles takes


@dataclass(frozen=True)
class Structure:
    """What stays the same while the poses and points move.

    Attributes:
        free: (F,) number among the frames that may move, -1 if held.
        n_free: Frames that may move.
        chunks: Every observation, once.
        half_bandwidth: Of the reduced matrix.
        tiles: How it is stored in tiles; absent: as a band.
    """

    free: IntArray
    n_free: int
    chunks: tuple[Chunk, ...]
    half_bandwidth: int
    tiles: TileLayout | None = None

    @cached_property
    def rows(self) -> int:
        """Rows of band storage, enough for every block."""
        widths = [g.width for chunk in self.chunks for g in chunk.groups if g.contiguous]
        return max([self.half_bandwidth, *widths]) + 1

    @cached_property
    def flops(self) -> float:
        """Multiplications and additions that one factorisation takes."""
        squares = float(sum(g.size * g.width for chunk in self.chunks for g in chunk.groups))
        if self.tiles is not None:
            return squares + self.tiles.flops
        return squares + POSE * self.n_free * float(self.half_bandwidth) ** 2

    @property
    def bytes(self) -> float:
        """Memory of the matrix, its factor, and the largest chunk's blocks."""
        band = POSE * self.n_free * (self.rows + self.half_bandwidth)
        matrix = band if self.tiles is None else 2 * self.tiles.size
        return 8.0 * (matrix + max((chunk.size for chunk in self.chunks), default=0))

    def fits(self, max_flops: float, max_bytes: float) -> bool:
        """Whether it stays within limits per factorisation."""
        return self.flops <= max_flops and self.bytes <= max_bytes

    def empty(self) -> Matrix:
        """The matrix of the free poses without entries."""
        if self.tiles is not None:
            return Tiles.zeros(self.tiles)
        return Band.zeros(POSE * self.n_free, self.rows)

    def cholesky(self, matrix: Matrix, least_pivot: FloatArray | float = 0.0) -> Matrix:
        """Its factor.

        Raises:
            NotPositiveDefiniteError: There is none, or a squared pivot is below (n,) ``least_pivot``.
        """
        if isinstance(matrix, Tiles):
            return matrix.cholesky(least_pivot)
        return matrix.cholesky(self.half_bandwidth, least_pivot)


def structure_of(problem: BundleProblem) -> Structure:
    """Order of the unknowns and blocks: a band, or tiles where those take fewer operations.

    Raises:
        ValueError: A landmark is seen twice in one frame.
    """
    pairs = problem.frame * len(problem.world_p_landmark) + problem.landmark
    if len(np.unique(pairs)) != len(pairs):
        raise ValueError("a landmark is seen twice in one frame")
    moves = ~problem.fixed_frames
    free = np.where(moves, np.cumsum(moves) - 1, -1)
    together = _frames_of_factors(problem, free)
    band = _as_band(problem, free, together)
    if band.flops <= _QUICK:
        return band
    tiles = _in_tiles(problem, free, together)
    return tiles if _DEARER * tiles.flops < band.flops else band


def _as_band(problem: BundleProblem, free: IntArray, together: list[IntArray]) -> Structure:
    span, group = _group(free[problem.frame], problem.landmark, len(problem.world_p_landmark))
    spans = [int(np.ptp(frames)) + 1 for frames in together]
    half_bandwidth = max(POSE * max(span, *spans, 0), POSE) - 1
    return Structure(free, int(np.sum(free >= 0)), chunks_of(problem, free, group), half_bandwidth)


def _in_tiles(problem: BundleProblem, free: IntArray, together: list[IntArray]) -> Structure:
    group = _group_by_tiles(free[problem.frame], problem.landmark, len(problem.world_p_landmark))
    chunks = chunks_of(problem, free, group)
    n_free = int(np.sum(free >= 0))
    seen = [g.frames for part in chunks for g in part.groups]
    return Structure(free, n_free, chunks, POSE * n_free - 1, tile_layout(n_free, [*seen, *together]))


def _frames_of_factors(problem: BundleProblem, free: IntArray) -> list[IntArray]:
    """Free frames of each pose factor that has any."""
    factors = (problem.pose_graph.at(i) for i in range(problem.pose_graph.size()))
    keys = [[key for key in list(f.keys()) if key not in problem.shared] for f in factors if f is not None]
    frames = free[problem.frames_of(chain.from_iterable(keys))]
    parts = np.split(frames, np.cumsum([len(part) for part in keys])[:-1])
    return [part[part >= 0] for part in parts if np.any(part >= 0)]


def _group(free: IntArray, landmark: IntArray, landmarks: int) -> tuple[int, IntArray]:
    """Longest span of a track, and (L,) the group of every landmark; 0 for those in no free frame.

    Lengths are binned by powers of two from 8, first frames by a quarter of a length: of the
    gradings tried, the one that balances empty entries against the number of blocks.
    """
    seen = free >= 0
    first, last = np.full(landmarks, np.iinfo(np.int64).max), np.full(landmarks, -1)
    np.minimum.at(first, landmark[seen], free[seen])
    np.maximum.at(last, landmark[seen], free[seen])
    tracked = last >= 0
    length = (last - first + 1)[tracked]
    exponent = np.ceil(np.log2(np.maximum(length, 8))).astype(np.int64)
    code = np.full(landmarks, -1)
    code[tracked] = exponent * (free.max(initial=0) + 1) + first[tracked] // 2 ** (exponent - 2)
    _, group = np.unique(np.append(code, -1), return_inverse=True)
    return int(length.max(initial=0)), group[:-1]


def _group_by_tiles(free: IntArray, landmark: IntArray, landmarks: int) -> IntArray:
    """(L,) the group of every landmark, one for each set of tiles; 0 for those in no free frame.

    A set is told by the sum of a random number for each of its tiles. Two that agreed by chance would share a
    block, which costs time and nothing else.
    """
    seen = free >= 0
    tiles = int(free.max(initial=0)) // TILE + 1
    pairs = np.unique(landmark[seen] * tiles + free[seen] // TILE)
    number = np.random.default_rng(0).integers(1, 2**62, tiles, dtype=np.uint64)
    code = np.zeros(landmarks, dtype=np.uint64)
    np.add.at(code, pairs // tiles, number[pairs % tiles])
    _, group = np.unique(np.append(code, np.uint64(0)), return_inverse=True)
    return group[:-1]

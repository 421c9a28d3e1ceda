"""Symbolic analysis: which frames are free, how landmarks are grouped, how the poses' matrix is stored.

The reduced matrix of the poses is stored as a band or, where places are revisited, in sparse blocks. The
structure of a problem stays the same while its poses and landmarks move, so it is analysed once.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.band_matrix import POSE_DIM, BandMatrix
from vgps.solver.block_layout import BlockLayout, layout_blocks
from vgps.solver.block_matrix import BlockSparseMatrix
from vgps.solver.landmark_groups import Chunk, group_by_blocks, group_by_track, split_into_chunks
from vgps.solver.problem import BundleProblem

__all__ = ["Chunk", "PoseMatrix", "SparsityStructure", "analyse_sparsity"]

PoseMatrix = BandMatrix | BlockSparseMatrix

_CHEAP_BAND_FLOPS = 5e9  # a band that takes fewer operations is used without comparing it with blocks
_BLOCK_SLOWDOWN = 4.0  # measured time of an operation in blocks relative to one in a band


@dataclass(frozen=True, kw_only=True)
class SparsityStructure:
    """Structure of the normal equations; it does not depend on the values of poses and landmarks.

    Attributes:
        free: (F,) number of each frame among the free ones, -1 if its pose is held.
        n_free: Number of free frames.
        chunks: The observations, each in one chunk.
        half_bandwidth: Number of subdiagonals of the reduced matrix.
        blocks: Layout of the reduced matrix in blocks; None if it is stored as a band.
    """

    free: IntArray
    n_free: int
    chunks: tuple[Chunk, ...]
    half_bandwidth: int
    blocks: BlockLayout | None = None

    @cached_property
    def rows(self) -> int:
        """Rows of band storage, enough to view every group's square as a block of the band."""
        widths = [g.width for chunk in self.chunks for g in chunk.groups if g.contiguous]
        return max([self.half_bandwidth, *widths]) + 1

    @cached_property
    def flops(self) -> float:
        """Multiplications and additions of one elimination and factorisation."""
        squares = float(sum(g.size * g.width for chunk in self.chunks for g in chunk.groups))
        if self.blocks is not None:
            return squares + self.blocks.flops
        return squares + POSE_DIM * self.n_free * float(self.half_bandwidth) ** 2

    @property
    def bytes(self) -> float:
        """Memory of the matrix, its factor, and the largest chunk's buffer."""
        band = POSE_DIM * self.n_free * (self.rows + self.half_bandwidth)
        matrix = band if self.blocks is None else 2 * self.blocks.size
        return 8.0 * (matrix + max((chunk.size for chunk in self.chunks), default=0))

    def fits(self, max_flops: float, max_bytes: float) -> bool:
        """Return whether one iteration stays within these limits."""
        return self.flops <= max_flops and self.bytes <= max_bytes

    def empty(self) -> PoseMatrix:
        """Return a zero matrix over the free poses."""
        if self.blocks is not None:
            return BlockSparseMatrix.zeros(self.blocks)
        return BandMatrix.zeros(POSE_DIM * self.n_free, self.rows)

    def cholesky(self, matrix: PoseMatrix, min_pivot: FloatArray | float = 0.0) -> PoseMatrix:
        """Return the Cholesky factor of a matrix.

        Raises:
            NotPositiveDefiniteError: There is none, or a squared pivot is not above ``min_pivot``, a number
                or (n,).
        """
        if isinstance(matrix, BlockSparseMatrix):
            return matrix.cholesky(min_pivot)
        return matrix.cholesky(self.half_bandwidth, min_pivot)


def analyse_sparsity(problem: BundleProblem) -> SparsityStructure:
    """Choose between a band and blocks, whichever is faster, and group the landmarks accordingly.

    Raises:
        ValueError: A landmark is observed twice in one frame.
    """
    pairs = problem.frame * len(problem.world_p_landmark) + problem.landmark
    if len(np.unique(pairs)) != len(pairs):
        raise ValueError("a landmark is observed twice in one frame")
    moves = ~problem.fixed_frames
    free = np.where(moves, np.cumsum(moves) - 1, -1)
    cliques = _frames_of_factors(problem, free)
    band = _band_structure(problem, free, cliques)
    if band.flops <= _CHEAP_BAND_FLOPS:
        return band
    blocks = _block_structure(problem, free, cliques)
    return blocks if _BLOCK_SLOWDOWN * blocks.flops < band.flops else band


def _band_structure(problem: BundleProblem, free: IntArray, cliques: list[IntArray]) -> SparsityStructure:
    span, group = group_by_track(free[problem.frame], problem.landmark, len(problem.world_p_landmark))
    spans = [int(np.ptp(frames)) + 1 for frames in cliques]
    return SparsityStructure(
        free=free,
        n_free=int(np.sum(free >= 0)),
        chunks=split_into_chunks(problem, free, group),
        half_bandwidth=max(POSE_DIM * max(span, *spans, 0), POSE_DIM) - 1,
    )


def _block_structure(problem: BundleProblem, free: IntArray, cliques: list[IntArray]) -> SparsityStructure:
    group = group_by_blocks(free[problem.frame], problem.landmark, len(problem.world_p_landmark))
    chunks = split_into_chunks(problem, free, group)
    n_free = int(np.sum(free >= 0))
    tracks = [g.frames for chunk in chunks for g in chunk.groups]
    return SparsityStructure(
        free=free,
        n_free=n_free,
        chunks=chunks,
        half_bandwidth=POSE_DIM * n_free - 1,
        blocks=layout_blocks(n_free, [*tracks, *cliques]),
    )


def _frames_of_factors(problem: BundleProblem, free: IntArray) -> list[IntArray]:
    """Return the free frames of each pose factor that has any."""
    factors = (problem.pose_graph.at(i) for i in range(problem.pose_graph.size()))
    keys = [[key for key in list(f.keys()) if key not in problem.shared] for f in factors if f is not None]
    frames = free[problem.frames_of(chain.from_iterable(keys))]
    parts = np.split(frames, np.cumsum([len(part) for part in keys])[:-1])
    return [part[part >= 0] for part in parts if np.any(part >= 0)]

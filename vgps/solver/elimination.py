"""Symbolic analysis: how landmarks are grouped, and how the matrix of poses and states is stored.

The reduced matrix is stored as a band or, where places are revisited, in sparse blocks. The
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
from vgps.solver.landmark_groups import Chunk, couple, group_by_blocks, group_by_track, split_into_chunks
from vgps.solver.problem import BundleProblem
from vgps.solver.unknowns import Unknowns, number_unknowns

__all__ = ["Chunk", "PoseMatrix", "SparsityStructure", "analyse_sparsity"]

PoseMatrix = BandMatrix | BlockSparseMatrix

_CHEAP_BAND_FLOPS = 5e9  # a band that takes fewer operations is used without comparing it with blocks
_BLOCK_SLOWDOWN = 4.0  # measured time of an operation in blocks relative to one in a band


@dataclass(frozen=True, kw_only=True)
class SparsityStructure(Unknowns):
    """Structure of the normal equations; it does not depend on the values of poses, states and landmarks.

    Attributes:
        chunks: The observations, each in one chunk.
        half_bandwidth: Number of subdiagonals of the reduced matrix.
        blocks: Layout of the reduced matrix in blocks; None if it is stored as a band.
    """

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
        """Return a zero matrix over free poses and states."""
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
    unknowns = number_unknowns(problem)
    cliques = _places_of_factors(problem, unknowns)
    band = _band_structure(problem, unknowns, cliques)
    if band.flops <= _CHEAP_BAND_FLOPS:
        return band
    blocks = _block_structure(problem, unknowns, cliques)
    return blocks if _BLOCK_SLOWDOWN * blocks.flops < band.flops else band


def _band_structure(problem: BundleProblem, unknowns: Unknowns, cliques: list[IntArray]) -> SparsityStructure:
    free = unknowns.free
    coupled = couple(problem, problem.landmark)
    span, group = group_by_track(free[coupled.frame], coupled.landmark, len(problem.world_p_landmark))
    spans = [int(np.ptp(places)) + 1 for places in cliques]
    return SparsityStructure(
        **vars(unknowns),
        chunks=split_into_chunks(problem, free, group),
        half_bandwidth=max(POSE_DIM * max(span, *spans, 0), POSE_DIM) - 1,
    )


def _block_structure(
    problem: BundleProblem, unknowns: Unknowns, cliques: list[IntArray]
) -> SparsityStructure:
    free, n_free = unknowns.free, unknowns.n_free
    coupled = couple(problem, problem.landmark)
    group = group_by_blocks(free[coupled.frame], coupled.landmark, len(problem.world_p_landmark))
    chunks = split_into_chunks(problem, free, group)
    tracks = [g.frames for chunk in chunks for g in chunk.groups]
    return SparsityStructure(
        **vars(unknowns),
        chunks=chunks,
        half_bandwidth=POSE_DIM * n_free - 1,
        blocks=layout_blocks(n_free, [*tracks, *cliques]),
    )


def _places_of_factors(problem: BundleProblem, unknowns: Unknowns) -> list[IntArray]:
    """Return the places of the free frames and the states of each pose factor that has any."""
    factors = (problem.pose_graph.at(i) for i in range(problem.pose_graph.size()))
    keys = [[key for key in list(f.keys()) if key not in problem.shared] for f in factors if f is not None]
    places = unknowns.places(problem, list(chain.from_iterable(keys)))
    parts = np.split(places, np.cumsum([len(part) for part in keys])[:-1])
    return [part[part >= 0] for part in parts if np.any(part >= 0)]

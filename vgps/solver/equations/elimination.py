"""Symbolic analysis: how landmarks are grouped, and how the matrix of poses and states is stored.

The reduced matrix is stored as a band or, where places are revisited, in sparse blocks. The
structure of a problem stays the same while its poses and landmarks move, so it is analysed once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.equations.chunks import Chunk, couple, split_into_chunks
from vgps.solver.equations.landmark_groups import group_by_blocks, group_by_track, track_ends
from vgps.solver.equations.unknowns import Unknowns, number_unknowns
from vgps.solver.matrices.band_matrix import POSE_DIM, BandMatrix
from vgps.solver.matrices.block_layout import BlockLayout, layout_blocks
from vgps.solver.matrices.block_matrix import BlockSparseMatrix
from vgps.solver.matrices.block_submaps import cut_blocks_into_submaps
from vgps.solver.matrices.submap_matrix import SubmapFactor, SubmapLayout, SubmapMatrix, cut_into_submaps
from vgps.solver.problem import BundleProblem

PoseMatrix = BandMatrix | BlockSparseMatrix | SubmapMatrix
PoseFactor = BandMatrix | BlockSparseMatrix | SubmapFactor

_CHEAP_BAND_FLOPS = 5e9  # a band that takes fewer operations is used without comparing it with blocks
_BLOCK_SLOWDOWN = 4.0  # measured time of an operation in blocks relative to one in a band


@dataclass(frozen=True, kw_only=True)
class SparsityStructure(Unknowns):
    """Structure of the normal equations; it does not depend on the values of poses, states and landmarks.

    Attributes:
        chunks: The observations, each in one chunk.
        half_bandwidth: Number of subdiagonals of the reduced matrix.
        blocks: Layout of the reduced matrix in blocks; None if it is stored as a band.
        submaps: Where the matrix is cut into submaps on disk; None if it is whole.
    """

    chunks: Sequence[Chunk]
    half_bandwidth: int
    blocks: BlockLayout | None = None
    submaps: SubmapLayout | None = None

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
        """Memory of the matrix, its factor, and the largest chunk's buffer; of the largest submap alone."""
        places = self.n_free if self.submaps is None else int(np.diff(self.submaps.first).max())
        matrix: float = POSE_DIM * places * (self.rows + self.half_bandwidth)
        if self.blocks is not None:
            matrix = 2.0 * self.blocks.size * places / self.n_free
        return 8.0 * (matrix + max((chunk.size for chunk in self.chunks), default=0))

    def fits(self, max_flops: float, max_bytes: float) -> bool:
        """Return whether one iteration, of a submap if there are any, stays within these limits."""
        submaps = 1 if self.submaps is None else len(self.submaps.first) - 1
        return self.flops <= max_flops * submaps and self.bytes <= max_bytes

    def empty(self) -> PoseMatrix:
        """Return a zero matrix over free poses and states."""
        if self.blocks is not None:
            return BlockSparseMatrix.zeros(self.blocks, on_disk=self.submaps is not None)
        if self.submaps is not None:
            return SubmapMatrix.zeros(self.submaps, self.rows)
        return BandMatrix.zeros(POSE_DIM * self.n_free, self.rows)

    def cholesky(self, matrix: PoseMatrix, min_pivot: FloatArray | float = 0.0) -> PoseFactor:
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
    _refuse_twice(problem)
    unknowns = number_unknowns(problem)
    cliques = _places_of_factors(problem, unknowns)
    band, group = _band_structure(problem, unknowns, cliques)
    if (
        problem.submap_frames is not None
        and band.submaps is None
        and unknowns.n_free > 2 * problem.submap_frames
    ):
        in_submaps = _block_structure(problem, unknowns, cliques, problem.submap_frames)
        if in_submaps.submaps is not None:
            return in_submaps
    blocks = None
    if band.flops > _CHEAP_BAND_FLOPS and band.submaps is None:
        blocks = _block_structure(problem, unknowns, cliques)
        if _BLOCK_SLOWDOWN * blocks.flops < band.flops:  # whatever its landmarks take, which are not laid out
            return blocks
    chunks = split_into_chunks(problem, unknowns.free, group, on_disk=band.submaps is not None)
    band = replace(band, chunks=chunks)
    if band.flops <= _CHEAP_BAND_FLOPS or band.submaps is not None:
        return band
    blocks = blocks or _block_structure(problem, unknowns, cliques)
    return blocks if _BLOCK_SLOWDOWN * blocks.flops < band.flops else band


def _refuse_twice(problem: BundleProblem) -> None:
    pairs = problem.frame * len(problem.world_p_landmark)
    pairs += problem.landmark
    pairs.sort()
    if np.any(pairs[1:] == pairs[:-1]):
        raise ValueError("a landmark is observed twice in one frame")


def _band_structure(
    problem: BundleProblem, unknowns: Unknowns, cliques: list[IntArray]
) -> tuple[SparsityStructure, IntArray]:
    """Return the structure of a band, yet without chunks, and (L,) the group of each landmark."""
    coupled = couple(problem, problem.landmark)
    places = unknowns.free[coupled.frame]
    first, last = track_ends(places, coupled.landmark, len(problem.world_p_landmark))
    span, group = group_by_track(first, last)
    spans = [int(np.ptp(places)) + 1 for places in cliques]
    submaps = None
    if problem.submap_frames is not None:
        submaps = _submaps(unknowns, (first, last), cliques, problem.submap_frames)
    if submaps is not None:  # a submap's landmarks after those of the one before
        number = np.searchsorted(submaps.first, np.minimum(first, unknowns.n_free - 1), side="right")
        _, group = np.unique(number * len(group) + group, return_inverse=True)
    half_bandwidth = max(POSE_DIM * max(span, *spans, 0), POSE_DIM) - 1
    band = SparsityStructure(**vars(unknowns), chunks=(), half_bandwidth=half_bandwidth, submaps=submaps)
    return band, group


def _submaps(
    unknowns: Unknowns, tracks: tuple[IntArray, IntArray], cliques: list[IntArray], frames: int
) -> SubmapLayout | None:
    """Return where the band is cut, by first and last places of tracks (L,); None if it stays whole."""
    last = np.arange(unknowns.n_free)
    seen = tracks[1] >= 0
    np.maximum.at(last, tracks[0][seen], tracks[1][seen])
    for places in cliques:
        last[places.min()] = max(last[places.min()], places.max())
    layout = cut_into_submaps(unknowns.n_free, last, frames)
    return layout if len(layout.first) > 2 else None


def _block_structure(
    problem: BundleProblem, unknowns: Unknowns, cliques: list[IntArray], submap_frames: int | None = None
) -> SparsityStructure:
    """Return the structure in blocks; in submaps on disk of so many frames, if it can be cut."""
    free, n_free = unknowns.free, unknowns.n_free
    coupled = couple(problem, problem.landmark)
    places, landmarks = free[coupled.frame], len(problem.world_p_landmark)
    group = group_by_blocks(places, coupled.landmark, landmarks)
    if submap_frames is not None:  # landmarks in order of the submaps that see them first
        first, _ = track_ends(places, coupled.landmark, landmarks)
        number = np.minimum(first, n_free) // submap_frames
        _, group = np.unique(number * len(group) + group, return_inverse=True)
    chunks = split_into_chunks(problem, free, group, on_disk=submap_frames is not None)
    cliques = [*(g.frames for chunk in chunks for g in chunk.groups), *cliques]
    cut = None if submap_frames is None else cut_blocks_into_submaps(n_free, cliques, submap_frames)
    submaps, stages = (None, None) if cut is None else cut
    return SparsityStructure(
        **vars(unknowns),
        chunks=chunks,
        half_bandwidth=POSE_DIM * n_free - 1,
        blocks=layout_blocks(n_free, cliques, stages),
        submaps=submaps,
    )


def _places_of_factors(problem: BundleProblem, unknowns: Unknowns) -> list[IntArray]:
    """Return the places of the free frames and the states of each pose factor that has any."""
    factors = (problem.pose_graph.at(i) for i in range(problem.pose_graph.size()))
    keys = [[key for key in list(f.keys()) if key not in problem.shared] for f in factors if f is not None]
    places = unknowns.places(problem, list(chain.from_iterable(keys)))
    parts = np.split(places, np.cumsum([len(part) for part in keys])[:-1])
    return [part[part >= 0] for part in parts if np.any(part >= 0)]

"""Chunks: landmarks with all their observations, laid out for elimination.

Observations of a group of landmarks form one dense matrix, and chunks of whole groups are processed one after
the other, so that their arrays stay in the processor's cache.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.runtime.threads import map_in_order
from vgps.solver.disk_arrays import DiskArrays, stored
from vgps.solver.equations.landmark_groups import split_between_groups
from vgps.solver.integer_sets import distinct, numbered
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.matrices.block_layout import BLOCK_FRAMES
from vgps.solver.problem import BundleProblem

CHUNK_OBSERVATIONS = 12000  # observations processed at a time: their arrays stay in the processor's cache


@dataclass(frozen=True)
class LandmarkGroup:
    """Landmarks observed in nearly the same frames, whose observations form one dense matrix Z.

    Attributes:
        frames: (s,) places of the frames that observe any of them, ascending, of the states between such
            frames that follow each other, and of all between them where these are few; the columns of these
            and of states are zero.
        landmarks: Number of landmarks.
        start: Index in the chunk's buffer at which Z, (3 landmarks, 6 s) in C order, begins.
    """

    frames: IntArray
    landmarks: int
    start: int

    @cached_property
    def width(self) -> int:
        """Number of columns of Z."""
        return POSE_DIM * len(self.frames)

    @property
    def size(self) -> int:
        """Number of entries of Z."""
        return 3 * self.landmarks * self.width

    @property
    def contiguous(self) -> bool:
        """Whether the frames follow each other without a gap."""
        return int(self.frames[-1] - self.frames[0]) + 1 == len(self.frames)

    def matrix(self, buffer: FloatArray) -> FloatArray:
        """Return Z, a view of the chunk's buffer."""
        return buffer[self.start : self.start + self.size].reshape(3 * self.landmarks, self.width)


@dataclass(frozen=True)
class Coupling:
    """Pairs of a landmark and a frame that observations couple, each pair once.

    Attributes:
        frame: (c,) frame of each pair.
        landmark: (c,) landmark of each pair.
        pair: (n, k) the pairs that each observation couples.
    """

    frame: IntArray
    landmark: IntArray
    pair: IntArray


@dataclass(frozen=True, kw_only=True)
class Chunk:
    """Some landmarks with all their observations.

    Attributes:
        problem: The problem reduced to these observations.
        landmarks: (m,) rows of the landmarks in the problem.
        landmark: (n,) index into ``landmarks`` of each observation.
        first_frame: Earliest frame that is coupled with any of them.
        frame: (n,) frame of each observation, counted from ``first_frame``; ascending where there are groups.
        coupled: Landmarks, as in ``landmark``, and the frames that move their observations, counted from
            ``first_frame``: the observations or, for a rolling shutter, also those in neighbouring frames.
        free_rows: (k,) coupled pairs with free frames.
        entry: (k, 3) indices in the chunk's buffer at which the three runs of six entries of such a pair
            begin.
        groups: Groups of the landmarks.
    """

    problem: BundleProblem
    landmarks: IntArray
    landmark: IntArray
    first_frame: int
    frame: IntArray
    coupled: Coupling
    free_rows: IntArray
    entry: IntArray
    groups: tuple[LandmarkGroup, ...]

    @cached_property
    def frames(self) -> int:
        """Number of frames from the first to the last."""
        return int(self.coupled.frame.max()) + 1

    @cached_property
    def _runs(self) -> IntArray:
        """Where runs of observations in the same frame begin."""
        return np.flatnonzero(np.diff(self.frame, prepend=-1))

    def sum_by_frame(self, values: FloatArray) -> FloatArray:
        """Return the sums (frames,) of values (n,) of the observations, which are in order of frames."""
        sums = np.zeros(self.frames)
        sums[self.frame[self._runs]] = np.add.reduceat(values, self._runs)
        return sums

    @cached_property
    def size(self) -> int:
        """Number of entries of the buffer that holds the matrices of all groups."""
        return sum(group.size for group in self.groups)


def couple(problem: BundleProblem, landmark: IntArray) -> Coupling:
    """Return the pairs of landmark and frame that observations of landmarks (N,) couple."""
    if problem.row_times is None:
        return Coupling(problem.frame, landmark, np.arange(len(landmark))[:, None])
    knots = problem.row_times.knots
    base = int(knots.max(initial=0)) + 1
    pairs, pair = np.unique(landmark[:, None] * base + knots, return_inverse=True)
    return Coupling(pairs % base, pairs // base, pair.reshape(knots.shape))


def split_into_chunks(
    problem: BundleProblem, free: IntArray, group: IntArray, on_disk: bool = False
) -> Sequence[Chunk]:
    """Split all observations into chunks of whole groups.

    Args:
        problem: The observations.
        free: (F,) place of each frame, -1 if it is held.
        group: (L,) group of each landmark.
        on_disk: Whether the chunks are kept on disk.
    """
    parts = split_between_groups(problem.frame, problem.landmark, group, CHUNK_OBSERVATIONS)
    chunks = map_in_order(partial(_chunk, problem, free, group), parts)
    return stored(chunks, _on_disk) if on_disk else tuple(chunks)


def _on_disk(chunk: Chunk, arrays: DiskArrays) -> Chunk:
    """Return the chunk with its observations on disk."""
    problem, kept = chunk.problem, arrays.kept
    return replace(
        chunk,
        problem=replace(
            problem,
            frame=kept(problem.frame),
            landmark=kept(problem.landmark),
            uv_px=kept(problem.uv_px),
            sigma_px=kept(problem.sigma_px),
            robust_k=None if problem.robust_k is None else kept(problem.robust_k),
            lens=None if problem.lens is None else kept(problem.lens),
        ),
        landmark=kept(chunk.landmark),
        frame=kept(chunk.frame),
        coupled=Coupling(*(kept(part) for part in vars(chunk.coupled).values())),
        free_rows=kept(chunk.free_rows),
        entry=kept(chunk.entry),
    )


def _chunk(problem: BundleProblem, free: IntArray, group: IntArray, rows: IntArray) -> Chunk:
    rows = rows[np.argsort(problem.frame[rows], kind="stable")]  # so that sums by frame run along memory
    part = problem.select_observations(rows)
    landmarks, landmark = numbered(part.landmark)
    coupled = couple(part, landmark)
    free_rows = np.flatnonzero(free[coupled.frame] >= 0)
    at = free[coupled.frame[free_rows]]
    groups, entry = _lay_out_groups(at, coupled.landmark[free_rows], group[landmarks], free[free >= 0])
    first = int(coupled.frame.min())
    return Chunk(
        problem=part,
        landmarks=landmarks,
        landmark=landmark,
        first_frame=first,
        frame=part.frame - first,
        coupled=replace(coupled, frame=coupled.frame - first),
        free_rows=free_rows,
        entry=entry,
        groups=groups,
    )


def _lay_out_groups(
    frame: IntArray, landmark: IntArray, group: IntArray, free: IntArray
) -> tuple[tuple[LandmarkGroup, ...], IntArray]:
    """Return the groups, and (k, 3) the buffer indices at which each observation's entries begin.

    Args:
        frame: (k,) place of each observation's frame, which is free.
        landmark: (k,) landmark of each observation.
        group: (m,) group of each landmark.
        free: Places of all free frames, ascending.
    """
    if not len(frame):
        return (), np.zeros((0, 3), dtype=np.int64)
    landmarks, landmark = numbered(landmark)
    _, group = numbered(group[landmarks])
    members = np.bincount(group)  # landmarks of each group
    rank = np.empty_like(group)  # of each landmark in its group
    before = np.repeat(np.cumsum(members) - members, members)
    rank[np.argsort(group, kind="stable")] = np.arange(len(group)) - before
    base = int(frame.max()) + 1
    of = group[landmark]
    pairs = _without_short_gaps(distinct(of * base + frame), base, free)
    pair = np.searchsorted(pairs, of * base + frame)
    first = np.searchsorted(pairs, np.arange(len(members) + 1) * base)
    groups: list[LandmarkGroup] = []
    for g, count in enumerate(members.tolist()):
        start = groups[-1].start + groups[-1].size if groups else 0
        groups.append(LandmarkGroup(pairs[first[g] : first[g + 1]] - g * base, count, start))
    width, start_of = np.array([g.width for g in groups])[of], np.array([g.start for g in groups])[of]
    begin = start_of + POSE_DIM * (pair - first[of])
    return tuple(groups), begin[:, None] + (3 * rank[landmark, None] + np.arange(3)) * width[:, None]


def _without_short_gaps(pairs: IntArray, base: int, free: IntArray) -> IntArray:
    """Return pairs ``group * base + place``, ascending, with the states between successive free frames.

    Gaps shorter than a block of the matrix are closed too. So a track with short interruptions stays one
    dense block of a band, or one in each block of a block matrix.
    """
    number = np.searchsorted(free, pairs % base)  # of each pair's frame among the free ones
    gap = np.diff(pairs)
    long = (np.diff(number) != 1) & (gap >= BLOCK_FRAMES)
    gap[long | (np.diff(pairs // base) != 0)] = 1
    before = np.repeat(pairs[:-1], gap - 1)
    steps = np.arange(len(before)) - np.repeat(np.cumsum(gap - 1) - (gap - 1), gap - 1) + 1
    return np.sort(np.concatenate([pairs, before + steps]))

"""The order in which landmarks are eliminated: groups of like tracks, each one dense block, chunk by chunk.

The Schur complement subtracts, for every landmark, a square over the frames that see it. Landmarks that begin
near each other and are tracked about equally long share one dense matrix product; its empty entries cost less
than any bookkeeping would.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import gtsam
import numpy as np
from scipy.linalg import blas

from vgps.model import FloatArray, IntArray
from vgps.smoothing.band import POSE, Band
from vgps.smoothing.bundle import BundleProblem

CHUNK = 12000  # observations worked on at a time: their arrays stay in the processor's cache


@dataclass(frozen=True)
class Group:
    """Landmarks seen in nearly the same frames, eliminated together as one dense block.

    Attributes:
        frames: (s,) free frames in which any of them is seen, ascending.
        landmarks: Their number.
        start: Where its block, (3 landmarks, 6 s) in C order, begins in its chunk's buffer.
    """

    frames: IntArray
    landmarks: int
    start: int

    @property
    def width(self) -> int:
        """Columns of the block."""
        return POSE * len(self.frames)

    @property
    def size(self) -> int:
        """Entries of the block."""
        return 3 * self.landmarks * self.width

    @property
    def contiguous(self) -> bool:
        """Whether no frame between its first and its last is missing."""
        return int(self.frames[-1] - self.frames[0]) + 1 == len(self.frames)

    def subtract_square(self, buffer: FloatArray, band: Band) -> None:
        """Subtract Z^T Z of its block Z from the matrix."""
        Z = buffer[self.start : self.start + self.size].reshape(3 * self.landmarks, self.width)
        square = blas.dsyrk(-1.0, Z.T, lower=1)
        if self.contiguous:
            band.add_lower(POSE * int(self.frames[0]), square)
            return
        rows, columns = np.tril_indices(self.width)
        index = (POSE * self.frames[:, None] + np.arange(POSE)).ravel()
        i, j = index[rows], index[columns]
        # no single track is longer than the band: entries beyond it are zero, and have no place of their own
        near = i - j < len(band.ab)
        band.add_entries(i[near], j[near], square[rows[near], columns[near]])


@dataclass(frozen=True)
class Chunk:
    """Landmarks with all their observations.

    Attributes:
        problem: The problem cut down to these observations.
        landmarks: (m,) rows of the landmarks, and ``landmark`` (n,) each observation's place among them.
        first_frame: The earliest frame; ``frame`` (n,) counts from it, up to ``frames``.
        seen: (k,) observations in free frames, and ``entry`` (k, 3) where in the buffer of all blocks their
            three runs of six entries begin.
        groups: The blocks.
    """

    problem: BundleProblem
    landmarks: IntArray
    landmark: IntArray
    first_frame: int
    frame: IntArray
    seen: IntArray
    entry: IntArray
    groups: tuple[Group, ...]

    @cached_property
    def frames(self) -> int:
        """Frames from the first to the last."""
        return int(self.frame.max()) + 1

    @cached_property
    def size(self) -> int:
        """Entries of all blocks."""
        return sum(group.size for group in self.groups)


@dataclass(frozen=True)
class Structure:
    """What stays the same while the poses and points move.

    Attributes:
        free: (F,) number among the frames that may move, -1 if held.
        n_free: Frames that may move.
        chunks: Every observation, once.
        half_bandwidth: Of the reduced matrix.
    """

    free: IntArray
    n_free: int
    chunks: tuple[Chunk, ...]
    half_bandwidth: int

    @cached_property
    def rows(self) -> int:
        """Rows of band storage, enough for every block."""
        widths = [g.width for chunk in self.chunks for g in chunk.groups if g.contiguous]
        return max([self.half_bandwidth, *widths]) + 1

    @property
    def flops(self) -> float:
        """Multiplications and additions that one factorisation takes."""
        squares = sum(g.size * g.width for chunk in self.chunks for g in chunk.groups)
        return float(squares) + POSE * self.n_free * float(self.half_bandwidth) ** 2

    @property
    def bytes(self) -> float:
        """Memory of the band, its factor, and the largest chunk's blocks."""
        band = POSE * self.n_free * (self.rows + self.half_bandwidth)
        return 8.0 * (band + max((chunk.size for chunk in self.chunks), default=0))

    def fits(self, max_flops: float, max_bytes: float) -> bool:
        """Whether it stays within limits per factorisation."""
        return self.flops <= max_flops and self.bytes <= max_bytes


def structure_of(problem: BundleProblem) -> Structure:
    """Order of the unknowns, bandwidth and blocks.

    Raises:
        ValueError: A landmark is seen twice in one frame.
    """
    pairs = problem.frame * len(problem.world_p_landmark) + problem.landmark
    if len(np.unique(pairs)) != len(pairs):
        raise ValueError("a landmark is seen twice in one frame")
    moves = ~problem.fixed_frames
    free = np.where(moves, np.cumsum(moves) - 1, -1)
    span, group = _group(free[problem.frame], problem.landmark, len(problem.world_p_landmark))
    order = np.lexsort((problem.frame, problem.landmark, group[problem.landmark]))
    span = max(span, _pose_graph_span(problem, free))
    parts = _parts(group[problem.landmark[order]], order)
    chunks = tuple(_chunk(problem, free, group, part) for part in parts)
    return Structure(free, int(moves.sum()), chunks, max(POSE * span, POSE) - 1)


def _pose_graph_span(problem: BundleProblem, free: IntArray) -> int:
    factors = (problem.pose_graph.at(i) for i in range(problem.pose_graph.size()))
    keys = [[key for key in list(f.keys()) if key not in problem.shared] for f in factors if f is not None]
    frames = free[problem.frames_of(chain.from_iterable(keys))]
    cuts = np.cumsum([len(part) for part in keys])[:-1]
    spans = [int(np.ptp(part[part >= 0])) + 1 for part in np.split(frames, cuts) if np.any(part >= 0)]
    return max(spans, default=0)


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


def _parts(group: IntArray, order: IntArray) -> list[IntArray]:
    """Cut the ordered observations between groups, into chunks of about the same number."""
    if not len(order):
        return []
    begins = np.flatnonzero(np.diff(group, prepend=-1))
    cuts = begins[np.flatnonzero(np.diff(begins // CHUNK, prepend=0))]
    return np.split(order, cuts)


def _chunk(problem: BundleProblem, free: IntArray, group: IntArray, part: IntArray) -> Chunk:
    frame, landmarks = problem.frame[part], problem.landmark[part]
    here = replace(
        problem,
        frame=frame,
        landmark=landmarks,
        uv_px=problem.uv_px[part],
        sigma_px=problem.sigma_px[part],
        robust_k=None if problem.robust_k is None else problem.robust_k[part],
        pose_graph=gtsam.NonlinearFactorGraph(),
        shared={},
    )
    rows, landmark = np.unique(landmarks, return_inverse=True)
    seen = np.flatnonzero(free[frame] >= 0)
    groups, entry = _lay_out(free[frame[seen]], landmark[seen], group[rows])
    first = int(frame.min())
    return Chunk(here, rows, landmark, first, frame - first, seen, entry, groups)


def _lay_out(frame: IntArray, landmark: IntArray, group: IntArray) -> tuple[tuple[Group, ...], IntArray]:
    """Blocks of the groups, and (k, 3) where each observation's entries begin.

    Args:
        frame: (k,) free frame of each observation.
        landmark: (k,) its landmark.
        group: (m,) group of each landmark.
    """
    if not len(frame):
        return (), np.zeros((0, 3), dtype=np.int64)
    _, group = np.unique(group[np.unique(landmark)], return_inverse=True)
    _, landmark = np.unique(landmark, return_inverse=True)
    number = np.bincount(group)  # of landmarks in each group
    place = np.empty_like(group)  # of each landmark in its group
    before = np.repeat(np.cumsum(number) - number, number)
    place[np.argsort(group, kind="stable")] = np.arange(len(group)) - before
    base = int(frame.max()) + 1
    pairs, pair = np.unique(group[landmark] * base + frame, return_inverse=True)
    first = np.searchsorted(pairs, np.arange(len(number) + 1) * base)
    groups: list[Group] = []
    for g, count in enumerate(number.tolist()):
        start = groups[-1].start + groups[-1].size if groups else 0
        groups.append(Group(pairs[first[g] : first[g + 1]] - g * base, count, start))
    of = group[landmark]
    width, start_of = np.array([g.width for g in groups])[of], np.array([g.start for g in groups])[of]
    begin = start_of + POSE * (pair - first[of])
    return tuple(groups), begin[:, None] + (3 * place[landmark, None] + np.arange(3)) * width[:, None]

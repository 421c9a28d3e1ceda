"""Landmarks eliminated together: groups of like tracks, each one dense block, chunk by chunk.

The Schur complement subtracts, for every landmark, a square over the frames that see it. Landmarks seen in
nearly the same frames share one dense matrix product; its empty entries cost less than any bookkeeping would.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import blas

from vgps.model import FloatArray, IntArray
from vgps.solver.band_matrix import POSE, Band
from vgps.solver.block_matrix import Tiles
from vgps.solver.problem import BundleProblem

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

    def subtract_square(self, buffer: FloatArray, matrix: Band | Tiles) -> None:
        """Subtract Z^T Z of its block Z from the matrix."""
        Z = buffer[self.start : self.start + self.size].reshape(3 * self.landmarks, self.width)
        matrix.add_square(self.frames, blas.dsyrk(-1.0, Z.T, lower=1))


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


def chunks_of(problem: BundleProblem, free: IntArray, group: IntArray) -> tuple[Chunk, ...]:
    """All observations, by the groups of their landmarks.

    Args:
        problem: The observations.
        free: (F,) number of each frame among those that may move, -1 if held.
        group: (L,) of each landmark.
    """
    order = np.lexsort((problem.frame, problem.landmark, group[problem.landmark]))
    parts = _parts(group[problem.landmark[order]], order)
    return tuple(_chunk(problem, free, group, part) for part in parts)


def _parts(group: IntArray, order: IntArray) -> list[IntArray]:
    """Cut the ordered observations between groups, into chunks of about the same number."""
    if not len(order):
        return []
    begins = np.flatnonzero(np.diff(group, prepend=-1))
    cuts = begins[np.flatnonzero(np.diff(begins // CHUNK, prepend=0))]
    return np.split(order, cuts)


def _chunk(problem: BundleProblem, free: IntArray, group: IntArray, part: IntArray) -> Chunk:
    here = problem.only(part)
    frame, landmarks = here.frame, here.landmark
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

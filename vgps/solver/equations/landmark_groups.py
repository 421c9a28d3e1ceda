"""Grouping of landmarks for elimination: landmarks with similar tracks share one dense matrix product.

For every landmark the Schur complement subtracts a square over the frames that observe it. Landmarks observed
in nearly the same frames are eliminated together; the empty entries of their common matrix cost less than
separate bookkeeping.
"""

import numpy as np

from vgps.model import IntArray
from vgps.solver.integer_sets import distinct, numbered
from vgps.solver.matrices.block_layout import BLOCK_FRAMES

_QUARTER = BLOCK_FRAMES // 4
_WORTH_A_GROUP = 60  # landmarks with which a group of its own saves more than it costs


def track_ends(free: IntArray, landmark: IntArray, landmarks: int) -> tuple[IntArray, IntArray]:
    """Return first and last place (L,) of each track; the largest integer and -1 in no free frame.

    Args:
        free: (N,) place of each observation's frame, -1 if it is held.
        landmark: (N,) landmark of each observation.
        landmarks: L.
    """
    observed = free >= 0
    if not observed.all():
        free, landmark = free[observed], landmark[observed]
    first, last = np.full(landmarks, np.iinfo(np.int64).max), np.full(landmarks, -1)
    np.minimum.at(first, landmark, free)
    np.maximum.at(last, landmark, free)
    return first, last


def group_by_track(first: IntArray, last: IntArray) -> tuple[int, IntArray]:
    """Group landmarks by length and first frame of their tracks.

    Lengths are binned by powers of two from 8, first frames by a quarter of a length; of the binnings tried
    this one balances empty entries against the number of groups best.

    Args:
        first, last: (L,) from :func:`track_ends`.

    Returns:
        Longest span of a track in places, and (L,) the group of each landmark, 0 for those in no free frame.
    """
    tracked = last >= 0
    length = (last - first + 1)[tracked]
    exponent = np.ceil(np.log2(np.maximum(length, 8))).astype(np.int64)
    code = np.full(len(last), -1)
    code[tracked] = exponent * (last.max(initial=0) + 1) + first[tracked] // 2 ** (exponent - 2)
    _, group = numbered(np.append(code, -1))
    return int(length.max(initial=0)), group[:-1]


def group_by_blocks(free: IntArray, landmark: IntArray, landmarks: int) -> IntArray:
    """Group landmarks by the set of blocks of frames that observe them.

    Where enough landmarks have a set of quarters of blocks in common, or else of halves, they form a group of
    fewer empty entries. A set is identified by the sum of a random number for each of its parts. Two sets
    with the same sum would share a group, which costs time but stays correct.

    Args:
        free: (N,) place of each observation's frame, -1 if it is held.
        landmark: (N,) landmark of each observation.
        landmarks: L.

    Returns:
        (L,) the group of each landmark, 0 for those in no free frame.
    """
    observed, rng = free >= 0, np.random.default_rng(0)
    parts = int(free.max(initial=0)) // _QUARTER + 1
    owner, part = np.divmod(distinct(landmark[observed] * parts + free[observed] // _QUARTER), parts)
    code = np.zeros(landmarks, dtype=np.uint64)
    for least in (_WORTH_A_GROUP, _WORTH_A_GROUP, 1):  # quarters, halves, blocks
        number = rng.integers(1, 2**62, parts, dtype=np.uint64)
        sums = np.zeros(landmarks, dtype=np.uint64)
        np.add.at(sums, owner, number[part])
        _, alike, count = np.unique(sums, return_inverse=True, return_counts=True)
        code = np.where((code == 0) & (count[alike] >= least), sums, code)
        owner, part = np.divmod(distinct(owner * parts + part // 2), parts)
    _, group = np.unique(np.append(code, np.uint64(0)), return_inverse=True)
    return group[:-1]


def split_between_groups(frame: IntArray, landmark: IntArray, group: IntArray, size: int) -> list[IntArray]:
    """Return the observations in order of group, landmark and frame, in parts of whole groups.

    Args:
        frame: (N,) frame of each observation.
        landmark: (N,) landmark of each observation.
        group: (L,) group of each landmark.
        size: Observations of a part, about.
    """
    if not len(frame):
        return []
    rank = np.empty(len(group), np.int64)
    rank[np.argsort(group, kind="stable")] = np.arange(len(group))
    key = rank[landmark]
    key *= int(frame.max()) + 1
    key += frame  # no two are equal
    sizes = np.bincount(group, np.bincount(landmark, minlength=len(group))).astype(np.int64)
    begins = (np.cumsum(sizes) - sizes)[sizes > 0]
    cuts = begins[np.flatnonzero(np.diff(begins // size, prepend=0))]
    return np.split(np.argsort(key), cuts)

"""Submaps of a recording with loops: blocks that only their own submap couples, and those between submaps.

The inner blocks of each submap are eliminated first, submap by submap; what they leave is a system over the
separators, which loops couple across any distance (nested dissection, George 1973). It is Cholesky's
factorisation of the whole, up to rounding.
"""

from collections.abc import Iterable

import numpy as np

from vgps.model import IntArray
from vgps.solver.matrices.block_layout import BLOCK_FRAMES, blocks_of
from vgps.solver.matrices.submap_matrix import SubmapLayout


def cut_blocks_into_submaps(
    places: int, cliques: Iterable[IntArray], frames: int
) -> tuple[SubmapLayout, list[IntArray]] | None:
    """Cut blocks between submaps of about so many frames.

    Args:
        places: Number of places.
        cliques: Sets of places; all of a set are coupled with each other.
        frames: Places of a submap.

    Returns:
        The submaps, and the stages of elimination: the inner blocks of each submap, then all separators,
        which are the blocks that are coupled with an earlier submap. None if fewer than two submaps have
        inner blocks.
    """
    first = _first_blocks(places, frames)
    blocks = -(-places // BLOCK_FRAMES)
    submap = np.searchsorted(first, np.arange(blocks), side="right") - 1
    between = np.zeros(blocks, dtype=bool)
    for clique in blocks_of(cliques):
        members = np.array(sorted(clique), np.int64)
        between[members[submap[members] > submap[members[0]]]] = True
    stages = [np.flatnonzero(~between & (submap == number)) for number in range(len(first))]
    if sum(len(stage) > 0 for stage in stages) < 2:
        return None
    sizes = np.minimum(BLOCK_FRAMES, places - BLOCK_FRAMES * np.arange(blocks))
    separator = np.bincount(submap, between * sizes, len(first)).astype(np.int64)
    layout = SubmapLayout(np.append(BLOCK_FRAMES * first, places), separator)
    return layout, [*stages, np.flatnonzero(between)]


def _first_blocks(places: int, frames: int) -> IntArray:
    """Return the first block of each submap."""
    count = max(places // max(frames, BLOCK_FRAMES), 1)
    return np.linspace(0, -(-places // BLOCK_FRAMES), count, endpoint=False).astype(np.int64)

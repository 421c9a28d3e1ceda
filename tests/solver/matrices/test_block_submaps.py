"""Which blocks belong to one submap alone, and which lie between submaps."""

import numpy as np

from vgps.solver.matrices.block_layout import BLOCK_FRAMES, layout_blocks
from vgps.solver.matrices.block_submaps import cut_blocks_into_submaps

B = BLOCK_FRAMES


def test_blocks_that_couple_with_an_earlier_submap_are_separators() -> None:
    """Three submaps of four blocks, the last 5 frames shorter, and a loop from block 1 to that block."""
    places = 12 * B - 5
    chain = [np.array([i, i + 1]) for i in range(places - 1)]
    found = cut_blocks_into_submaps(places, [*chain, np.array([B, 11 * B])], 4 * B - 5)
    assert found is not None
    layout, stages = found
    np.testing.assert_array_equal(layout.first, [0, 4 * B, 8 * B, places])
    np.testing.assert_array_equal(layout.separator, [0, B, 2 * B - 5])
    assert [stage.tolist() for stage in stages] == [[0, 1, 2, 3], [5, 6, 7], [9, 10], [4, 8, 11]]


def test_stages_are_eliminated_one_after_the_other() -> None:
    chain = [np.array([B * i, B * i + B]) for i in range(5)]
    layout = layout_blocks(6 * B, chain, [np.array([4, 2]), np.array([0, 5]), np.array([3, 1])])
    assert [sorted(layout.order[i : i + 2].tolist()) for i in (0, 2, 4)] == [[2, 4], [0, 5], [1, 3]]
    assert layout.below[0].tolist() == [1]  # couples with no other
    assert sorted(layout.below[2].tolist()) == [1, 3]


def test_a_single_submap_is_no_result() -> None:
    """All frames see one landmark: every block of a later submap is coupled with the first one."""
    assert cut_blocks_into_submaps(12 * B, [np.arange(12 * B)], 4 * B) is None
    assert cut_blocks_into_submaps(6 * B, [], 4 * B) is None

import numpy as np

from vgps.solver.equations.landmark_groups import (
    group_by_blocks,
    group_by_track,
    split_between_groups,
    track_ends,
)
from vgps.solver.matrices.block_layout import BLOCK_FRAMES


def test_landmarks_of_similar_tracks_form_a_group() -> None:
    # tracks 0 and 1 have lengths 8 and 7 from frames 0 and 1; 2 comes later; 3 is longer; 4 is in held frames
    tracks = [range(8), range(1, 8), range(20, 28), range(12), [-1, -1]]
    landmark = np.repeat(np.arange(5), [len(track) for track in tracks])
    span, group = group_by_track(*track_ends(np.concatenate([list(track) for track in tracks]), landmark, 6))
    assert span == 12
    assert group[0] == group[1]
    assert len({group[0], group[2], group[3]}) == 3
    assert group[4] == group[5] == 0


def test_span_of_a_track_counts_the_gap() -> None:
    assert group_by_track(*track_ends(np.array([3, 40]), np.array([0, 0]), 1))[0] == 38
    assert group_by_track(*track_ends(np.zeros(0, int), np.zeros(0, int), 2))[0] == 0


def test_landmarks_in_the_same_blocks_form_a_group() -> None:
    # landmarks 0 and 1 are observed in blocks 0 and 3, landmark 2 in block 0 alone
    free = np.array([0, 3 * BLOCK_FRAMES, 5, 3 * BLOCK_FRAMES + 1, 7, -1])
    group = group_by_blocks(free, np.array([0, 0, 1, 1, 2, 3]), 4)
    assert group[0] == group[1] != group[2]
    assert group[3] == 0


def test_many_landmarks_in_the_same_quarters_of_blocks_form_their_own_group() -> None:
    last = BLOCK_FRAMES - 1
    in_a_quarter, in_another, in_both, in_a_half = [0, 1], [last], [0, last], [0, BLOCK_FRAMES // 4]
    tracks = [in_a_quarter] * 60 + [in_another] * 59 + [in_both] + [in_a_half] * 60
    landmark = np.repeat(np.arange(180), [len(track) for track in tracks])
    group = group_by_blocks(np.concatenate(tracks), landmark, 180)
    assert [len(np.unique(group[part])) for part in (slice(60), slice(60, 120), slice(120, 180))] == [1, 1, 1]
    assert len(np.unique(group)) == 3


def test_parts_have_whole_groups_in_order_of_group_landmark_and_frame() -> None:
    frame, landmark = np.array([3, 1, 2, 0, 5, 4, 1]), np.array([0, 0, 1, 2, 2, 3, 3])
    group = np.array([2, 0, 0, 2, 1, 3])  # landmarks 4 and 5, and so groups 1 and 3, were never observed
    assert [part.tolist() for part in split_between_groups(frame, landmark, group, 2)] == [
        [2, 3, 4],
        [1, 0, 6, 5],
    ]
    whole = split_between_groups(frame, landmark, group, 100)
    assert [part.tolist() for part in whole] == [[2, 3, 4, 1, 0, 6, 5]]
    nothing = np.zeros(0, np.int64)
    assert split_between_groups(nothing, nothing, group, 2) == []

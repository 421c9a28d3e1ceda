import numpy as np

from vgps.mapping.observation_log import ObservationLog


def log():
    """Frames 3 (twice), 5 and 6."""
    made = ObservationLog()
    for frame, ids in ((3, [7, 8]), (3, [9]), (5, [8, 9]), (6, [])):
        made.append(frame, np.array(ids, dtype=np.int64), np.full((len(ids), 2), float(frame)))
    return made


def test_observations_come_in_order_from_a_frame_on():
    every = log().since(0)
    assert every.frame.tolist() == [3, 3, 3, 5, 5] and every.landmark.tolist() == [7, 8, 9, 8, 9]
    np.testing.assert_array_equal(every.uv_px, np.repeat([[3.0] * 2, [5.0] * 2], (3, 2), axis=0))
    for frame in (4, 5):
        assert log().since(frame).landmark.tolist() == [8, 9]
    for frame in (6, 7):
        none = log().since(frame)
        assert len(none.frame) == len(none.landmark) == 0 and none.uv_px.shape == (0, 2)


def test_tracks_are_rows_by_feature_and_columns_by_frame():
    none, three, five = [np.nan] * 2, [3.0] * 2, [5.0] * 2
    tracks = log().tracks(np.array([9, 4, 7]), np.array([-1, 3, 5, 6]))
    expected = [[none, three, five, none], [none] * 4, [none, three, none, none]]
    np.testing.assert_array_equal(tracks, expected)
    np.testing.assert_array_equal(log().tracks(np.array([8]), np.array([5, 6])), [[five, none]])
    assert log().tracks(np.array([], dtype=np.int64), np.array([3, 5])).shape == (0, 2, 2)
    assert np.isnan(log().tracks(np.array([8]), np.array([-1, -1]))).all()


def test_older_frames_are_discarded():
    made = log()
    made.discard_before(5)
    assert made.since(0).frame.tolist() == [5, 5]


def test_the_smallest_id_is_that_of_all_batches_or_the_default():
    assert log().smallest_id(100) == 7 and log().smallest_id(4) == 4
    assert ObservationLog().smallest_id(100) == 100


def test_ids_are_lowered_in_every_batch():
    made = log()
    made.lower_ids(7)
    assert made.since(0).landmark.tolist() == [0, 1, 2, 1, 2]


def test_a_copy_does_not_follow_the_original():
    made = log()
    twin = made.copy()
    made.append(7, np.array([1]), np.zeros((1, 2)))
    made.discard_before(7)
    assert twin.since(0).frame.tolist() == [3, 3, 3, 5, 5]

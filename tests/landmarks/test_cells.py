import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_landmarks import random_contents

from vgps.landmarks.cells import concatenated_ranges, partition, pixel_sizes_m


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 300), size=st.integers(1, 40))
def test_every_point_is_in_one_group_of_its_octave(seed: int, count: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    points, octave = rng.normal(size=(count, 3)), rng.integers(-2, 2, count)
    groups = partition(points, octave, size)
    assert sorted(np.concatenate([*groups, np.zeros(0, int)]).tolist()) == list(range(count))
    for rows in groups:
        assert 1 <= len(rows) <= size
        assert len(set(octave[rows].tolist())) == 1


def test_a_group_is_halved_across_its_widest_axis() -> None:
    points = np.array([[0.0, 0, 0], [1, 9, 0], [0, 1, 0], [1, 10, 0]])
    groups = partition(points, np.zeros(4, int), 2)
    assert sorted(rows.tolist() for rows in groups) == [[0, 2], [1, 3]]


def test_ranges_one_after_the_other() -> None:
    ranges = concatenated_ranges(np.array([5, 0, 7]), np.array([2, 0, 3]))
    assert ranges.tolist() == [5, 6, 7, 8, 9]
    assert concatenated_ranges(np.zeros(0, int), np.zeros(0, int)).tolist() == []


def test_the_pixel_size_is_the_mean_of_both_sides() -> None:
    views = random_contents(1).views
    # the axes are distance / 260 and distance / 255 metres long
    distance = np.linalg.norm(views.world_p_camera - views.world_p_landmark, axis=1)
    np.testing.assert_allclose(pixel_sizes_m(views), distance / np.sqrt(260.0 * 255.0))

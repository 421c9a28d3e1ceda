"""Matching of frames by time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.evaluation import match_times
from vgps.evaluation.association import half_interval_s
from vgps.model import FloatArray


def test_each_time_is_matched_at_most_once() -> None:
    rows, others = match_times(np.array([0.0, 0.1, 0.2]), np.array([0.21, 0.09, 0.12, 5.0]), 0.05)
    assert rows.tolist() == [1, 2]
    assert others.tolist() == [1, 0]


times = st.lists(st.floats(-100, 100), min_size=1, max_size=30, unique=True).map(np.array)


@pytest.mark.slow
@given(a=times, b=times, tolerance_s=st.floats(0, 10))
def test_pairs_are_mutual_nearest_neighbours(a: FloatArray, b: FloatArray, tolerance_s: float) -> None:
    rows, others = match_times(a, b, tolerance_s)
    distance = np.abs(a[:, None] - b)
    assert len(set(rows.tolist())) == len(set(others.tolist())) == len(rows)
    for row, other in zip(rows, others, strict=True):
        assert distance[row, other] == distance[row].min() == distance[:, other].min() <= tolerance_s
    closest = np.unravel_index(np.argmin(distance), distance.shape)
    assert len(rows) > 0 or distance[closest] > tolerance_s


def test_half_the_median_interval() -> None:
    assert half_interval_s(np.array([0.3, 0.0, 0.1, 0.2, 5.0])) == pytest.approx(0.05)
    assert half_interval_s(np.array([7.0])) == 1e-3

"""Even times beside time stamps, and how much smoother a path is over them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.geometry.even_times import even_times, smoother_by


@given(
    st.integers(0, 2**32 - 1),
    st.integers(30, 300),
    st.floats(0.01, 2.0),
    st.floats(0.0, 0.15),
    st.floats(0.0, 0.2),
)
def test_stamps_about_a_line_have_its_times(seed, count, interval_s, off, missing):
    """Some of the line are missing. All are late by the mean of what stamps are off by."""
    rng = np.random.default_rng(seed)
    number = np.flatnonzero(rng.random(2 * count) >= missing)[:count]
    off_s = off * interval_s * rng.uniform(-1.0, 1.0, len(number))
    late_s = even_times(3.0 + interval_s * number + off_s) - 3.0 - interval_s * number
    assert np.abs(late_s).max() <= 2.0 * off * interval_s + 1e-9 * count


def test_what_came_late_came_at_once():
    """A tenth of a second late now and then at thirty a second: steps of four intervals and of none."""
    true_s = np.arange(200) / 30.0
    stamps_s = np.maximum.accumulate(true_s + 0.1 * (np.arange(200) % 20 == 3)) + 1e-6 * np.arange(200)
    assert np.ptp(even_times(stamps_s) - true_s) < 0.01
    assert np.ptp(stamps_s - true_s) > 0.09


def test_an_interval_that_may_be_whole_is():
    """One of a second with stamps off by a tenth is; one of 1.0053 s without errors is not."""
    off_s = 0.1 * (-1.0) ** np.arange(40) * np.linspace(1.0, 0.5, 40)
    np.testing.assert_allclose(np.diff(even_times(np.arange(40) + off_s, 0.01)), 1.0, atol=1e-12)
    assert np.diff(even_times(1.02 * np.arange(40) + off_s, 0.01))[0] == pytest.approx(1.02)
    assert np.diff(even_times(1.0053 * np.arange(400), 0.01))[0] == pytest.approx(1.0053)


def test_a_path_is_smoother_over_its_own_times():
    t_s = np.arange(60) / 10.0
    stamps_s = t_s + np.random.default_rng(0).uniform(-0.02, 0.02, 60)
    place_m = np.stack([8.0 * t_s + np.sin(t_s), np.cos(t_s), 0.1 * t_s], axis=1)
    gain = smoother_by((stamps_s, t_s), place_m)
    assert gain > 60.0
    assert smoother_by((t_s, stamps_s), place_m) == pytest.approx(-gain)
    place_m[20:23] = np.nan
    assert 40.0 < smoother_by((stamps_s, t_s), place_m) < gain
    assert smoother_by((stamps_s, t_s), np.zeros((60, 3))) == 0.0


def test_jerks_are_those_of_a_cubic():
    """Of t^3 the third divided difference is one, over any times; of the same over others it is not."""
    t_s = np.array([0.0, 0.3, 1.0, 1.2, 2.0])
    cubic_m = np.column_stack([2.0 * t_s**3, np.zeros(5)])
    doubled = smoother_by((t_s, 2.0 * t_s), cubic_m)
    assert doubled == pytest.approx(2 * np.log(8.0), abs=1e-4)

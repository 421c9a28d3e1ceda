"""The last digits of a log are found, in degrees or minutes, whatever was added to its heights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Fix, from_sea_level, last_digits
from vgps.readers.gps_formats.last_digits import LastDigits

RNG = np.random.default_rng(0)
LATITUDE_DEG, LONGITUDE_DEG = 60.0 + 1e-3 * RNG.random((2, 20))  # half as far to the east as to the north
HEIGHT_M = 100.0 + RNG.random(20)


def steps_m(latitude_deg=LATITUDE_DEG, longitude_deg=LONGITUDE_DEG, height_m=HEIGHT_M):
    return LastDigits().add(latitude_deg, longitude_deg, height_m).steps_m


@pytest.mark.parametrize(
    ("decimals", "per_degree", "north_m"),
    [(5, 1, 1.11), (6, 1, 0.111), (7, 1, 0.0111), (8, 1, 0.0), (3, 60, 1.85), (4, 60, 0.185), (6, 60, 0.0)],
)
def test_steps_are_those_of_degrees_or_minutes_down_to_a_centimetre(decimals, per_degree, north_m):
    rounded = np.round(per_degree * np.array([LATITUDE_DEG, LONGITUDE_DEG]), decimals) / per_degree
    np.testing.assert_allclose(steps_m(*rounded), [north_m / 2, north_m, 0.0], rtol=3e-3)


@pytest.mark.parametrize(("decimals", "step_m"), [(0, 1.0), (1, 0.1), (2, 0.01), (3, 0.0)])
def test_heights_have_steps_of_their_own(decimals, step_m):
    np.testing.assert_allclose(steps_m(height_m=HEIGHT_M.round(decimals)), [0.0, 0.0, step_m])


def test_an_error_is_uniform_over_a_step():
    height_m = np.linspace(0.0, 10.0, 10_001)
    found = LastDigits().add(np.zeros(1), np.zeros(1), height_m.round(1)).rounding_m[2]
    assert found == pytest.approx((height_m.round(1) - height_m).std(), rel=0.01)


def test_what_was_added_to_a_height_above_the_sea_is_no_digit_of_the_log():
    places = zip(LATITUDE_DEG.tolist(), LONGITUDE_DEG.tolist(), HEIGHT_M.round(1).tolist(), strict=True)
    fixes = [Fix(n, *place, FixClass.SINGLE, n + 1) for n, place in enumerate(places)]
    raised, _ = from_sea_level(fixes)
    assert raised[0].height_m != fixes[0].height_m
    assert last_digits(raised).steps_m[2] == pytest.approx(0.1)


@given(
    decimals=st.integers(3, 7),
    first=st.integers(1, 19),
    latitude_deg=st.floats(-80.0, 80.0),  # nearer to a pole a degree's length changes within a log
    longitude_deg=st.floats(-179.0, 179.0),
)
def test_digits_are_the_same_at_once_and_one_after_another(decimals, first, latitude_deg, longitude_deg):
    latitude = np.round(latitude_deg + LATITUDE_DEG - 60.0, decimals)
    longitude = np.round(longitude_deg + LONGITUDE_DEG - 60.0, decimals)
    places = np.array([latitude, longitude, HEIGHT_M.round(2)])
    later = LastDigits().add(*places[:, :first])
    coarse_m = later.steps_m
    later.add(*places[:, first:])
    np.testing.assert_allclose(later.steps_m, steps_m(*places), rtol=1e-3)
    assert (later.steps_m <= coarse_m * (1 + 1e-3)).all()
    assert later.steps_m[1] >= 0.999 * 111_000.0 * 10.0**-decimals

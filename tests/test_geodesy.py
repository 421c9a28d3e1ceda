import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.geodesy import ecef_to_geodetic, enu_R_ecef, heading_deg, normal_gravity, to_enu, to_geodetic
from vgps.model import GeodeticPoint

A, F = 6378137.0, 1 / 298.257223563  # WGS84
latitudes = st.one_of(st.sampled_from([-90.0, 0.0, 90.0]), st.floats(-90, 90))
longitudes = st.one_of(st.sampled_from([-180.0, 180.0, 179.9999999, 0.0]), st.floats(-180, 180))
offsets = st.tuples(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4), st.floats(-500, 5000))


def ecef_by_hand(lat: float, lon: float, h: float) -> np.ndarray:
    """Eq. (8)-(10), Kume 2010: the radius of curvature and the three coordinates."""
    b, lo, e2 = np.radians(lat), np.radians(lon), F * (2 - F)
    n = A / np.sqrt(1 - e2 * np.sin(b) ** 2)
    return np.array(
        [(n + h) * np.cos(b) * np.cos(lo), (n + h) * np.cos(b) * np.sin(lo), (n * (1 - e2) + h) * np.sin(b)]
    )


@pytest.mark.slow
@given(latitudes, longitudes, offsets)
def test_enu_comes_back_from_geodetic_anywhere(lat, lon, enu):
    origin = GeodeticPoint(lat, lon, 100.0)
    place = to_geodetic(origin, enu)
    assert -180 <= place[1] <= 180
    np.testing.assert_allclose(to_enu(origin, *place), enu, atol=1e-5)


@pytest.mark.slow
@given(latitudes, longitudes, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-100, 5000))
def test_enu_is_the_ecef_difference_rotated_at_the_origin(lat, lon, dlat, dlon, h):
    origin = GeodeticPoint(lat, lon, 50.0)
    place = (float(np.clip(lat + dlat, -90, 90)), lon + dlon, h)
    b, lo = np.radians(lat), np.radians(lon)
    east = np.array([-np.sin(lo), np.cos(lo), 0])
    up = np.array([np.cos(b) * np.cos(lo), np.cos(b) * np.sin(lo), np.sin(b)])
    R = np.stack([east, np.cross(up, east), up])
    expected = R @ (ecef_by_hand(*place) - ecef_by_hand(*origin))
    np.testing.assert_allclose(to_enu(origin, *place), expected, atol=1e-5)
    np.testing.assert_allclose(enu_R_ecef(lat, lon), R, atol=1e-12)


def test_one_second_of_arc_at_the_equator():
    enu = to_enu(GeodeticPoint(0, 0, 0), [0.0, 0.0, 0.0], [1 / 3600, -1 / 3600, 0.0], [0.0, 0.0, 7.0])
    np.testing.assert_allclose(enu[:, 0], [A * np.radians(1 / 3600), -A * np.radians(1 / 3600), 0], atol=1e-6)
    np.testing.assert_allclose(enu[2], [0, 0, 7], atol=1e-9)


def test_the_antimeridian_is_no_step():
    enu = to_enu(GeodeticPoint(10, 179.99999, 0), [10.0, 10.0], [-179.99999, 180.00001], 0.0)
    np.testing.assert_allclose(enu[0], enu[1], atol=1e-8)
    assert 2.1 < enu[0, 0] < 2.3


def test_nan_stays_in_its_row():
    enu = to_enu(GeodeticPoint(49, 8, 100), [49.0, np.nan], [8.0, 8.0], [100.0, 100.0])
    np.testing.assert_allclose(enu[0], 0, atol=1e-9)
    assert np.isnan(enu[1]).any()


def test_ecef_agrees_with_the_formula():
    places = np.array([[49.011, 8.4165, 163.0], [-33.9, 151.2, -20.0]])
    xyz = np.array([ecef_by_hand(*place) for place in places])
    np.testing.assert_allclose(ecef_to_geodetic(xyz), places, atol=1e-8)
    np.testing.assert_allclose(np.stack(pymap3d.geodetic2ecef(*places.T), axis=1), xyz, atol=1e-7)


@pytest.mark.parametrize(
    ("forward", "expected"),
    [
        ((0, 1, 0), 0),
        ((1, 0, 0), 90),
        ((0, -1, 0), 180),
        ((-1, 0, 0), 270),
        ((-1e-18, 1, 0), 0),
        ((0, 0, 1), np.nan),
    ],
)
def test_heading_is_clockwise_from_north(forward, expected):
    pose = np.eye(4)
    pose[:3, 2] = forward
    np.testing.assert_allclose(heading_deg(pose[None]), [expected], atol=1e-9)
    np.testing.assert_allclose(heading_deg(pose[:3, :3]), expected, atol=1e-9)


def test_gravity_is_that_of_the_place() -> None:
    assert normal_gravity(GeodeticPoint(0.0, 0.0, 0.0)) == pytest.approx(9.7803253359, abs=1e-9)
    assert normal_gravity(GeodeticPoint(90.0, 0.0, 0.0)) == pytest.approx(9.8321849378, abs=1e-8)
    assert normal_gravity(GeodeticPoint(45.0, 7.0, 1000.0)) == pytest.approx(9.806199 - 0.003086, abs=1e-5)

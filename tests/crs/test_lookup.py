from datetime import UTC, datetime, timedelta, timezone
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Transformer

from vgps.crs import ELLIPSOIDAL, coordinate_system, decimal_year, egm96
from vgps.errors import CoordinateSystemError

PLACE = (49.0, 8.4)
POINT = np.array([[49.0, 8.4, 160.0]])


def test_without_a_system_coordinates_are_longitude_latitude_height():
    system = coordinate_system(PLACE)
    assert system.from_geodetic(POINT).tolist() == [[8.4, 49.0, 160.0]]
    assert system.description == f"WGS 84 (EPSG:4979), {ELLIPSOIDAL}"
    assert system.is_geographic and system.notes == ()


def test_utm_by_hand():
    # the central meridian of zone 32 has the easting 500 km; 9 degrees east
    found = coordinate_system(PLACE, "EPSG:32632").from_geodetic(np.array([[0.0, 9.0, 5.0]]))
    np.testing.assert_allclose(found, [[500000.0, 0.0, 5.0]], atol=1e-6)


def test_heights_above_egm96_need_no_grid_of_proj():
    undulation = egm96().height_m(49.0, 8.4)
    for crs, geoid in (("EPSG:32632+5773", None), ("EPSG:32632", "egm96"), (None, "egm96")):
        system = coordinate_system(PLACE, crs, geoid)
        assert system.from_geodetic(POINT)[0, 2] == pytest.approx(160.0 - undulation, abs=1e-9)
        assert system.height_datum == "height above the geoid EGM96"


@pytest.mark.slow
def test_a_vertical_datum_without_its_grid_is_refused():
    with pytest.raises(
        CoordinateSystemError,
        match=r"EPSG:25832\+7837 needs the grid de_bkg_gcg2016\.tif, which is not installed; .*--geoid FILE",
    ):
        coordinate_system(PLACE, "EPSG:25832+7837")


def test_a_geoid_replaces_the_missing_grid():
    system = coordinate_system(PLACE, "EPSG:25832+7837", "48.5")
    assert system.from_geodetic(POINT)[0, 2] == 160.0 - 48.5
    assert system.height_datum == "height above a geoid 48.5 m above the ellipsoid"
    assert system.axes == ("easting_m", "northing_m", "height_m")


@pytest.mark.slow
def test_the_frame_of_the_fixes_moves_against_europe():
    """ETRS89 is fixed to Europe, which has moved by some 2.5 cm a year since 1989."""
    plain = coordinate_system(PLACE, "EPSG:25832").from_geodetic(POINT)
    moved = [
        coordinate_system(PLACE, "EPSG:25832", source="EPSG:9989", epoch=year).from_geodetic(POINT)
        for year in (2015.0, 2025.0)
    ]
    shift = np.hypot(*(plain - moved[1])[0, :2])
    assert 0.8 < shift < 1.0
    per_year = np.hypot(*(moved[1] - moved[0])[0, :2]) / 10
    assert 0.02 < per_year < 0.03


def test_frames_taken_as_one_are_said():
    (note,) = coordinate_system(PLACE, "EPSG:25832").notes
    assert "up to 1 m" in note and "--gps-crs" in note

    notes = coordinate_system(PLACE, "EPSG:31467").notes
    assert "less accurate without the grid" in notes[0] and "accurate to 3 m" in notes[1]


@pytest.mark.slow
def test_a_frame_that_was_named_is_not_asked_for():
    (note,) = coordinate_system(PLACE, "EPSG:32632", source="EPSG:9989").notes
    assert note.startswith("ITRF2020 and the datum of WGS 84 / UTM zone 32N are taken as one")
    with pytest.raises(CoordinateSystemError, match=r"no conversion from ITRF2020 to EPSG:6690.*--gps-crs"):
        coordinate_system((34.7, 135.7), "EPSG:6690", source="EPSG:9989")


def test_units_are_in_the_names_of_the_axes():
    system = coordinate_system((40.7, -74.0), "EPSG:2263")
    assert system.axes == ("easting_us_ft", "northing_us_ft", "height_m")


@pytest.mark.parametrize(
    ("crs", "message"),
    [
        ("EPSG:99999", "no coordinate system 'EPSG:99999'; expected EPSG:NNNN"),
        ("EPSG:5773", "EGM96 height has heights alone"),
        ("EPSG:6677", r"EPSG:6677 \(JGD2011.*\) is for .*; the run lies at 49\.0000°, 8\.4000°"),
    ],
)
def test_a_wrong_system_is_refused_in_a_line(crs, message):
    with pytest.raises(CoordinateSystemError, match=message):
        coordinate_system(PLACE, crs)


def test_geocentric_coordinates_agree_with_proj():
    system = coordinate_system(PLACE, "EPSG:4978")
    oracle = Transformer.from_crs(4979, 4978).transform(49.0, 8.4, 160.0)
    np.testing.assert_allclose(system.from_geodetic(POINT)[0], oracle, atol=1e-6)


made = cache(lambda crs: coordinate_system(PLACE, crs))


@settings(max_examples=25)
@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-100, 4000))
@pytest.mark.parametrize("crs", ["EPSG:25832", "EPSG:31467", "EPSG:4978", "EPSG:32632+5773"])
def test_there_and_back_within_a_tenth_of_a_millimetre(crs, north, east, height):
    system = made(crs)
    point = np.array([[49.0 + north, 8.4 + east, height], [np.nan, 8.0, 1.0]])
    back = system.to_geodetic(system.from_geodetic(point))
    np.testing.assert_allclose(back[0, :2], point[0, :2], atol=1e-9)
    assert back[0, 2] == pytest.approx(height, abs=1e-4)
    assert np.isnan(back[1]).any()


def test_decimal_years():
    assert decimal_year(datetime(2026, 1, 1)) == 2026.0
    assert decimal_year(datetime(2026, 7, 2, 12, tzinfo=UTC)) == 2026.5  # day 182.5 of 365
    assert decimal_year(datetime(2024, 7, 2, tzinfo=UTC)) == 2024.5  # day 183 of 366
    east = timezone(timedelta(hours=9))
    assert decimal_year(datetime(2026, 1, 1, 9, tzinfo=east)) == 2026.0
    assert 9999.99 < decimal_year(datetime(9999, 12, 31, tzinfo=UTC)) < 10000

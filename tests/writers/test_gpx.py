"""GPX read back by gpxpy, and by the reader of this house."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import gpxpy
import numpy as np
import pytest
from exports import exported

from vgps.errors import CoordinateSystemError, RunFolderError
from vgps.geodesy import to_geodetic
from vgps.readers.gps_formats.gpx import read_gpx

START = datetime(2026, 5, 1, 9, 30, 12, 500000, tzinfo=UTC)


@pytest.fixture
def timed(solution):
    return replace(solution, video_start_utc=START)


def points_of(solution, tmp_path, **options):
    gpx = gpxpy.parse(exported(solution, tmp_path, "gpx", "run.gpx", **options).read_text(encoding="utf-8"))
    return gpx, gpx.tracks[0].segments[0].points


def test_every_frame_is_a_point_at_its_place_and_time(timed, tmp_path):
    gpx, points = points_of(timed, tmp_path)
    expected = to_geodetic(timed.world_origin, timed.world_T_camera[:, :3, 3])
    found = np.array([[p.latitude, p.longitude, p.elevation] for p in points])
    np.testing.assert_allclose(found[:, :2], expected[:, :2], rtol=0, atol=1e-10)
    np.testing.assert_allclose(found[:, 2], expected[:, 2], rtol=0, atol=1e-4)
    # on the clock of the log, whose positions are older than their time stamps
    assert points[1].time - START == timedelta(seconds=0.1 + timed.sensors.time_offset_s)
    assert gpx.creator == "vgps" and gpx.name == "wälk"
    assert gpx.description == "ele: height above the WGS 84 ellipsoid."
    assert all(p.geoid_height is None for p in points)


def test_with_a_geoid_heights_are_above_it_and_say_so(timed, tmp_path):
    gpx, points = points_of(timed, tmp_path, geoid="47.9")
    expected = to_geodetic(timed.world_origin, timed.world_T_camera[:, :3, 3])[:, 2]
    np.testing.assert_allclose([p.elevation + 47.9 for p in points], expected, atol=1e-4)
    assert {p.geoid_height for p in points} == {47.9}
    assert gpx.description == "ele: height above a geoid 47.9 m above the ellipsoid."


@pytest.mark.slow
def test_reading_back_restores_the_ellipsoidal_height_with_and_without_geoid(timed, tmp_path):
    heights = []
    for geoid in (None, "47.9", "egm96"):
        file = exported(timed, tmp_path, "gpx", "run.gpx", geoid=geoid)
        log = read_gpx(file.read_bytes(), file)
        heights.append([fix.height_m for fix in log.fixes])
        assert log.fixes[0].t_s == pytest.approx(START.timestamp() + timed.sensors.time_offset_s, abs=1e-3)
    np.testing.assert_allclose(heights[1:], [heights[0]] * 2, atol=2e-4)


def test_a_start_in_another_zone_is_the_same_instant(timed, tmp_path):
    local = replace(timed, video_start_utc=START.astimezone(timezone(timedelta(hours=9))))
    assert points_of(local, tmp_path)[1][0].time == points_of(timed, tmp_path)[1][0].time


def test_without_a_start_points_have_no_time_and_the_description_says_so(solution, tmp_path):
    gpx, points = points_of(replace(solution, video_start_utc=None, recording=None), tmp_path)
    assert all(p.time is None for p in points) and "points have no time" in gpx.description


def test_formats_without_a_geoid_say_which_have_one(timed, tmp_path):
    with pytest.raises(
        RunFolderError, match=r"--geoid for geojson: .*; expected --geoid with .*, kml, gpx, csv"
    ):
        exported(timed, tmp_path, "geojson", "a.json", geoid="40")
    assert not (tmp_path / "a.json").exists()


@pytest.mark.parametrize("geoid", ["nan", "inf"])
def test_a_geoid_must_have_a_height(timed, tmp_path, geoid):
    with pytest.raises(CoordinateSystemError, match=rf"a geoid height of {geoid}; expected a finite number"):
        exported(timed, tmp_path, "kml", "x.kml", geoid=geoid)
    assert not (tmp_path / "x.kml").exists()


def test_kml_is_drawn_at_its_height_only_with_a_geoid(timed, tmp_path):
    flat = exported(timed, tmp_path, "kml", "flat.kml").read_text()
    high = exported(timed, tmp_path, "kml", "high.kml", geoid="40").read_text()
    assert "absolute" not in flat and "height above the WGS 84 ellipsoid" in flat
    assert "<altitudeMode>absolute</altitudeMode>" in high
    first = float(high.split("<coordinates>")[1].split()[0].split(",")[2])
    expected = to_geodetic(timed.world_origin, timed.world_T_camera[0, :3, 3])[2] - 40.0
    assert first == pytest.approx(expected)


def test_a_run_without_georeference_is_refused(solution, tmp_path):
    with pytest.raises(RunFolderError, match="not georeferenced"):
        exported(replace(solution, georeferenced=False), tmp_path, "gpx", "x.gpx")

"""GPX read back by gpxpy, and by the reader of this house."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import gpxpy
import numpy as np
import pytest

from vgps.errors import RunFolderError
from vgps.geodesy import to_geodetic
from vgps.readers.gpx import read_gpx
from vgps.writers.export import export
from vgps.writers.gpx import write_gpx
from vgps.writers.maps import write_kml
from vgps.writers.run_folder import write_run

START = datetime(2026, 5, 1, 9, 30, 12, 500000, tzinfo=UTC)


@pytest.fixture
def timed(solution):
    return replace(solution, video_start_utc=START)


def points_of(solution, out, **how):
    write_gpx(solution, out, **how)
    gpx = gpxpy.parse(out.read_text(encoding="utf-8"))
    return gpx, gpx.tracks[0].segments[0].points


def test_every_frame_is_a_point_at_its_place_and_time(timed, tmp_path):
    gpx, points = points_of(timed, tmp_path / "run.gpx")
    expected = to_geodetic(timed.world_origin, timed.world_T_camera[:, :3, 3])
    found = np.array([[p.latitude, p.longitude, p.elevation] for p in points])
    np.testing.assert_allclose(found[:, :2], expected[:, :2], rtol=0, atol=1e-10)
    np.testing.assert_allclose(found[:, 2], expected[:, 2], rtol=0, atol=1e-4)
    assert points[1].time - START == timedelta(seconds=0.1)
    assert gpx.creator == "vgps" and gpx.name == "wälk"
    assert "above the WGS84 ellipsoid, not above the sea" in gpx.description
    assert all(p.geoid_height is None for p in points)


def test_with_a_geoid_heights_are_above_it_and_say_so(timed, tmp_path):
    gpx, points = points_of(timed, tmp_path / "run.gpx", geoid_m=47.9)
    expected = to_geodetic(timed.world_origin, timed.world_T_camera[:, :3, 3])[:, 2]
    np.testing.assert_allclose([p.elevation + 47.9 for p in points], expected, atol=1e-4)
    assert {p.geoid_height for p in points} == {47.9}
    assert "geoid, taken to be 47.9 m above the WGS84 ellipsoid" in gpx.description


def test_reading_back_restores_the_ellipsoidal_height_with_and_without_geoid(timed, tmp_path):
    heights = []
    for geoid_m in (None, 47.9):
        write_gpx(timed, tmp_path / "run.gpx", geoid_m)
        log = read_gpx((tmp_path / "run.gpx").read_bytes(), tmp_path / "run.gpx")
        heights.append([fix.height_m for fix in log.fixes])
        assert log.fixes[0].t_s == START.timestamp()
    np.testing.assert_allclose(*heights, atol=2e-4)


def test_a_start_in_another_zone_is_the_same_instant(timed, tmp_path):
    local = replace(timed, video_start_utc=START.astimezone(timezone(timedelta(hours=9))))
    assert points_of(local, tmp_path / "run.gpx")[1][0].time == START


def test_without_a_start_points_have_no_time_and_the_description_says_so(solution, tmp_path):
    gpx, points = points_of(replace(solution, video_start_utc=None, recording=None), tmp_path / "run.gpx")
    assert all(p.time is None for p in points) and "points have no time" in gpx.description


def test_export_takes_a_geoid_for_gpx_and_kml_alone(timed, tmp_path):
    write_run(timed, tmp_path / "run")
    export(tmp_path / "run", "gpx", tmp_path / "a.gpx", geoid_m=40.0)
    assert "geoidheight>40.0<" in (tmp_path / "a.gpx").read_text()
    with pytest.raises(RunFolderError, match="heights above the geoid in tum"):
        export(tmp_path / "run", "tum", tmp_path / "a.tum", geoid_m=40.0)
    assert not (tmp_path / "a.tum").exists()


@pytest.mark.parametrize("geoid_m", [np.nan, np.inf])
def test_a_geoid_must_have_a_height(timed, tmp_path, geoid_m):
    write_run(timed, tmp_path / "run")
    with pytest.raises(RunFolderError, match=r"--geoid is (nan|inf); expected a number of metres"):
        export(tmp_path / "run", "kml", tmp_path / "x.kml", geoid_m)
    assert not (tmp_path / "x.kml").exists()


def test_kml_is_drawn_at_its_height_only_with_a_geoid(timed, tmp_path):
    write_kml(timed, tmp_path / "flat.kml")
    write_kml(timed, tmp_path / "high.kml", 40.0)
    assert "absolute" not in (tmp_path / "flat.kml").read_text()
    high = (tmp_path / "high.kml").read_text()
    assert "<altitudeMode>absolute</altitudeMode>" in high
    first = float(high.split("<coordinates>")[1].split()[0].split(",")[2])
    expected = to_geodetic(timed.world_origin, timed.world_T_camera[0, :3, 3])[2] - 40.0
    assert first == pytest.approx(expected)


def test_a_run_without_georeference_is_refused(solution, tmp_path):
    with pytest.raises(RunFolderError, match="not georeferenced"):
        write_gpx(replace(solution, georeferenced=False), tmp_path / "x.gpx")

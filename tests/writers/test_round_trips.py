"""New formats read back by their consumers or by independent libraries: 1 mm and 0.01 degrees."""

import csv
import json
import sqlite3
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import jsonschema
import numpy as np
import pytest
from angles import apart_deg
from distinct_solution import distinct_values
from exports import exported
from scipy.spatial.transform import Rotation
from solutions import make_poses

from vgps.crs import coordinate_system
from vgps.errors import RunFolderError
from vgps.geodesy import enu_R_ecef, to_geodetic

MILLIMETRE, ANGLE_DEG = 1e-3, 0.01
START = datetime(2026, 5, 1, 23, 59, 59, 900000, tzinfo=UTC)


@pytest.fixture
def near():
    """The run with its last frame near the others, 2 km from the origin, where verticals differ."""
    solution = distinct_values()
    places = [
        [2000.0, -1000.0, 30.0],
        [2001.0, -1000.5, 30.1],
        [2002.0, -1001.0, 30.2],
        [2003.0, -1001.0, 30],
    ]
    rotations = solution.world_T_camera[:, :3, :3]
    return replace(solution, world_T_camera=make_poses(np.array(places), rotations), video_start_utc=START)


def geodetic(solution):
    return to_geodetic(solution.world_origin, solution.world_T_camera[:, :3, 3])


def metres(found, expected):
    """Return the distances [m] between latitudes, longitudes, heights (N, 3)."""
    scale = [111_000.0, 111_000.0 * np.cos(np.radians(expected[0, 0])), 1.0]
    return np.linalg.norm((np.asarray(found) - expected) * scale, axis=1)


def local_rotations(solution):
    """Rotations (F, 3, 3) from the camera to east, north, up at its own place, by hand."""
    place = geodetic(solution)
    here, origin = enu_R_ecef(place[:, 0], place[:, 1]), enu_R_ecef(*solution.world_origin[:2])
    return here @ origin.T @ solution.world_T_camera[:, :3, :3]


def test_csv_in_a_projected_system(near, tmp_path):
    file = exported(near, tmp_path, "csv", "a.csv", crs="EPSG:32632", geoid="egm96")
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    system = coordinate_system(near.world_origin[:2], "EPSG:32632", "egm96")
    found = np.array([[float(row[k]) for k in ("easting_m", "northing_m", "height_egm96_m")] for row in rows])
    assert metres(system.to_geodetic(found), geodetic(near)).max() < MILLIMETRE
    angles = np.array([[float(row[k]) for k in ("heading_deg", "pitch_deg", "roll_deg")] for row in rows])
    # heading, pitch, roll put together again: from a level camera that looks north
    turned = Rotation.from_euler("ZXY", angles * [-1, 1, 1], degrees=True).as_matrix()
    level = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert apart_deg(turned @ level, local_rotations(near)).max() < ANGLE_DEG
    assert rows[0]["crs"] == "WGS 84 / UTM zone 32N (EPSG:32632)" and rows[0]["image"] == "frame_000000.jpg"
    offset = timedelta(seconds=near.sensors.time_offset_s)
    assert abs(datetime.fromisoformat(rows[0]["utc"]) - START - offset) < timedelta(microseconds=2)


def test_csv_with_chosen_columns(near, tmp_path):
    file = exported(near, tmp_path, "csv", "a.csv", columns=("frame", "x", "height", "qw"))
    assert file.read_text().splitlines()[0] == "frame,longitude_deg,height_ellipsoidal_m,qw"
    with pytest.raises(RunFolderError, match=r"no column speed; expected of image, frame, t_s, .*state"):
        exported(near, tmp_path, "csv", "b.csv", columns=("speed",))
    with pytest.raises(RunFolderError, match="--columns for tum: it has no columns to choose"):
        exported(near, tmp_path, "tum", "b.tum", columns=("t_s",))


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_las_by_laspy(near, tmp_path, name):
    laspy = pytest.importorskip("laspy")
    cloud = laspy.read(exported(near, tmp_path, "las", name, crs="EPSG:32632", geoid="egm96"))
    system = coordinate_system(near.world_origin[:2], "EPSG:32632", "egm96")
    expected = to_geodetic(near.world_origin, near.landmarks.world_p_landmark)
    assert metres(system.to_geodetic(cloud.xyz), expected).max() < MILLIMETRE
    assert cloud["observations"].tolist() == [2, 0, 2]
    np.testing.assert_allclose(cloud["sigma_px"], near.landmarks.sigma_px)
    assert (cloud.red // 257).tolist() == near.landmarks.gray.tolist()
    crs = cloud.header.parse_crs()
    assert crs.is_compound and [part.to_epsg() for part in crs.sub_crs_list] == [32632, 5773]


@pytest.mark.slow
def test_geopackage_by_gdal(near, tmp_path):
    pyogrio = pytest.importorskip("pyogrio")
    file = exported(near, tmp_path, "gpkg", "a.gpkg", crs="EPSG:32632")
    assert [row[0] for row in pyogrio.list_layers(file)] == ["path", "frames", "fixes"]
    meta, _, geometry, fields = pyogrio.raw.read(file, layer="frames")
    assert meta["crs"] == "EPSG:32632"
    points = np.array([np.frombuffer(one[5:], "<f8") for one in geometry])
    system = coordinate_system(near.world_origin[:2], "EPSG:32632")
    assert metres(system.to_geodetic(points), geodetic(near)).max() < MILLIMETRE
    columns = dict(zip(meta["fields"], fields, strict=True))
    assert columns["frame"].tolist() == [0, 1, 2, 3] and "height_ellipsoidal_m" in columns
    meta, _, geometry, fields = pyogrio.raw.read(file, layer="fixes")
    columns = dict(zip(meta["fields"], fields, strict=True))
    assert columns["verdict"].tolist() == list(near.fixes.verdict)
    _, _, (line,), _ = pyogrio.raw.read(file, layer="path")
    assert int.from_bytes(line[5:9], "little") == 4
    with sqlite3.connect(file) as base:
        assert base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        described = base.execute("SELECT description FROM gpkg_contents").fetchall()
    assert all("height above the WGS 84 ellipsoid" in one for (one,) in described)


@pytest.mark.slow
def test_geopackage_in_a_system_without_a_code(near, tmp_path):
    pyogrio = pytest.importorskip("pyogrio")
    own = "+proj=tmerc +lat_0=49 +lon_0=8.4 +datum=WGS84 +units=m"
    file = exported(near, tmp_path, "gpkg", "a.gpkg", crs=own)
    meta, _, geometry, _ = pyogrio.raw.read(file, layer="frames")
    assert "Transverse" in meta["crs"] and len(geometry) == 4


GEOPOSE = {
    "type": "object",
    "required": ["position", "quaternion"],
    "properties": {
        "position": {
            "type": "object",
            "required": ["lat", "lon", "h"],
            "properties": {
                "lat": {"type": "number", "minimum": -90, "maximum": 90},
                "lon": {"type": "number", "minimum": -180, "maximum": 180},
                "h": {"type": "number"},
            },
        },
        "quaternion": {
            "type": "object",
            "required": ["x", "y", "z", "w"],
            "properties": {k: {"type": "number", "minimum": -1, "maximum": 1} for k in "xyzw"},
        },
    },
}


def test_geopose_by_the_standard_s_schema(near, tmp_path):
    poses = json.loads(exported(near, tmp_path, "geopose", "a.json").read_text())
    jsonschema.validate(poses, {"type": "array", "items": GEOPOSE})
    found = np.array([[pose["position"][k] for k in ("lat", "lon", "h")] for pose in poses])
    assert metres(found, geodetic(near)).max() < MILLIMETRE
    turned = Rotation.from_quat([[pose["quaternion"][k] for k in "xyzw"] for pose in poses]).as_matrix()
    # x forward, y left, z up
    camera_axes = np.stack([-turned[:, :, 1], -turned[:, :, 2], turned[:, :, 0]], axis=2)
    assert apart_deg(camera_axes, local_rotations(near)).max() < ANGLE_DEG
    offset_ms = round(1000 * near.sensors.time_offset_s)
    assert poses[0]["validTime"] == round(START.timestamp() * 1000) + offset_ms


# ImageDescriptionFileSchema of mapillary_tools 0.14, shortened to what is required and its patterns
MAPILLARY = {
    "type": "object",
    "required": ["MAPLatitude", "MAPLongitude", "MAPCaptureTime", "filename", "filetype"],
    "additionalProperties": False,
    "properties": {
        "filename": {"type": "string"},
        "filetype": {"enum": ["image"]},
        "MAPLatitude": {"type": "number", "minimum": -90, "maximum": 90},
        "MAPLongitude": {"type": "number", "minimum": -180, "maximum": 180},
        "MAPAltitude": {"type": "number"},
        "MAPGPSAccuracyMeters": {"type": "number"},
        "MAPCaptureTime": {
            "type": "string",
            "pattern": "[0-9]{4}_[0-9]{2}_[0-9]{2}_[0-9]{2}_[0-9]{2}_[0-9]{2}_[0-9]+",
        },
        "MAPCompassHeading": {
            "type": "object",
            "properties": {"TrueHeading": {"type": "number"}, "MagneticHeading": {"type": "number"}},
            "required": ["TrueHeading", "MagneticHeading"],
            "additionalProperties": False,
        },
    },
}


def test_mapillary_by_its_schema(near, tmp_path):
    shifted = replace(near, sensors=replace(near.sensors, time_offset_s=0.25))
    found = json.loads(exported(shifted, tmp_path, "mapillary", "a.json", geoid="egm96").read_text())
    jsonschema.validate(found, {"type": "array", "items": MAPILLARY})
    assert found[0]["filename"] == str(tmp_path / "frame_000000.jpg")
    # 23:59:59.9 and the estimated offset: the next day
    assert [one["MAPCaptureTime"] for one in found][:2] == [
        "2026_05_02_00_00_00_150",
        "2026_05_02_00_00_00_250",
    ]
    system = coordinate_system(near.world_origin[:2], None, "egm96")
    place = np.array([[one["MAPLongitude"], one["MAPLatitude"], one["MAPAltitude"]] for one in found])
    assert metres(system.to_geodetic(place), geodetic(near)).max() < MILLIMETRE
    forward = local_rotations(near)[:, :, 2]
    heading = np.degrees(np.arctan2(forward[:, 0], forward[:, 1])) % 360
    np.testing.assert_allclose(
        [one["MAPCompassHeading"]["TrueHeading"] for one in found], heading, atol=ANGLE_DEG
    )


def test_mapillary_needs_the_start_of_the_video(near, tmp_path):
    with pytest.raises(RunFolderError, match=r"start of the video in UTC is unknown; .* set video_start_utc"):
        exported(replace(near, video_start_utc=None), tmp_path, "mapillary", "a.json")


def test_tum_and_ply_in_a_projected_system_say_so(near, tmp_path):
    tum = exported(near, tmp_path, "tum", "a.tum", crs="EPSG:32632", geoid="egm96").read_text()
    assert (
        "easting_m, northing_m, height_m: WGS 84 / UTM zone 32N (EPSG:32632), height above the geoid EGM96"
        in tum
    )
    ply = exported(near, tmp_path, "ply", "a.ply", crs="EPSG:32632").read_bytes()
    assert b"height above the WGS 84 ellipsoid" in ply.split(b"end_header")[0]


@pytest.mark.slow
@pytest.mark.parametrize("to", ["csv", "las", "gpkg", "geopose", "mapillary", "exif"])
def test_a_run_without_a_place_is_refused(near, tmp_path, to):
    with pytest.raises(RunFolderError, match="not georeferenced"):
        exported(replace(near, georeferenced=False), tmp_path, to, "a.x")
    with pytest.raises(RunFolderError, match="--crs or --geoid for a run that is not georeferenced"):
        exported(replace(near, georeferenced=False), tmp_path, "tum", "a.x", crs="EPSG:32632")


@pytest.mark.parametrize("to", ["gpx", "kml", "geojson", "geopose", "colmap"])
def test_formats_whose_coordinates_are_prescribed_refuse_others(near, tmp_path, to):
    with pytest.raises(
        RunFolderError, match=f"--crs for {to}: its coordinates are prescribed; expected --crs with"
    ):
        exported(near, tmp_path, to, "a.x", crs="EPSG:32632")

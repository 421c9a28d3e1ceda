"""EXIF read back by exifread, XMP by an XML parser, pixels by PyAV."""

import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import datetime, timedelta

import exifread
import numpy as np
import pytest
from exports import exported
from PIL import Image
from scipy.spatial.transform import Rotation
from solutions import make_fixes, make_gps_log, make_solution

from vgps.crs import egm96
from vgps.errors import RunFolderError, VideoError
from vgps.geodesy import enu_R_ecef, heading_deg, to_geodetic
from vgps.model import FixClass
from vgps.writers.exif import pix4d_angles_deg
from vgps.writers.frame_choice import FrameChoice
from vgps.writers.jpeg import with_metadata

CAMERA = "{http://pix4d.com/camera/1.0}"


def tags_of(file):
    with file.open("rb") as stream:
        return exifread.process_file(stream)


def xmp_of(file):
    text = file.read_bytes().split(b"<x:xmpmeta", 1)[1].split(b"</x:xmpmeta>")[0]
    root = ET.fromstring("<x:xmpmeta" + text.decode() + "</x:xmpmeta>")
    (described,) = root.iter("{http://www.w3.org/1999/02/22-rdf-syntax-ns#}Description")
    return {key.removeprefix(CAMERA): value for key, value in described.attrib.items() if CAMERA in key}


def number(tag, sign=1):
    return sign * float(sum(float(part) / 60**k for k, part in enumerate(tag.values)))


@pytest.fixture(scope="module")
def frames(true_run, tmp_path_factory):
    """Every tenth frame of the simulated recording, with one used fix, and the folder of images."""
    log = replace(make_gps_log(np.array([0.0]), (FixClass.RTK_FIX,)), hdop=np.array([0.85]))
    run = replace(true_run, gps=log, fixes=make_fixes(np.zeros((1, 3))))
    choice = FrameChoice(every_s=1.0)
    out = exported(run, tmp_path_factory.mktemp("exif"), "exif", "out", choice=choice, geoid="egm96")
    return run, out


@pytest.mark.slow
def test_extracted_frames_have_position_accuracy_heading_and_time(frames):
    run, out = frames
    names = sorted(file.name for file in out.glob("*.jpg"))
    rows = [int(name[6:12]) for name in names]
    assert len(rows) == np.floor(run.t_s[-1] + 1e-9) + 1 and rows[0] == 0
    place = to_geodetic(run.world_origin, run.world_T_camera[:, :3, 3])
    for name, row in zip(names, rows, strict=True):
        tags = tags_of(out / name)
        latitude, longitude = number(tags["GPS GPSLatitude"]), number(tags["GPS GPSLongitude"])
        assert abs(latitude - place[row, 0]) * 111_000 < 1e-3
        assert abs(longitude - place[row, 1]) * 111_000 < 1e-3
        altitude = float(tags["GPS GPSAltitude"].values[0])
        assert altitude == pytest.approx(place[row, 2] - egm96().height_m(*place[row, :2]), abs=1e-3)
        assert float(tags["GPS GPSImgDirection"].values[0]) == pytest.approx(
            heading_deg(run.world_T_camera[row]), abs=0.01
        )
        assert float(tags["GPS GPSDOP"].values[0]) == 0.85
        assert float(tags["GPS Tag 0x001F"].values[0]) == pytest.approx(0.01 * np.sqrt(2), abs=1e-4)
        taken = datetime.strptime(
            f"{tags['EXIF DateTimeOriginal']}.{tags['EXIF SubSecTimeOriginal']}+0000",
            "%Y:%m:%d %H:%M:%S.%f%z",
        )
        assert abs(taken - run.video_start_utc - timedelta(seconds=run.t_s[row])) < timedelta(microseconds=2)
    assert "height above the geoid EGM96" in (out / "georeference.txt").read_text()


@pytest.mark.slow
def test_xmp_has_datum_accuracy_and_angles(frames):
    run, out = frames
    file = sorted(out.glob("*.jpg"))[1]
    xmp, row = xmp_of(file), int(file.name[6:12])
    assert xmp["VertCS"] == "height above the geoid EGM96"
    assert (float(xmp["GPSXYAccuracy"]), float(xmp["GPSZAccuracy"])) == pytest.approx((0.0141, 0.01))
    ned_R_body = Rotation.from_euler("ZYX", [float(xmp[k]) for k in ("Yaw", "Pitch", "Roll")], degrees=True)
    place = to_geodetic(run.world_origin, run.world_T_camera[row, :3, 3])
    local = enu_R_ecef(*place[:2]) @ enu_R_ecef(*run.world_origin[:2]).T @ run.world_T_camera[row, :3, :3]
    east, north, up = np.eye(3)
    enu_R_ned = np.column_stack([north, east, -up])
    # the body's axes: the image's top, its right, the optical axis
    body = np.column_stack([-local[:, 1], local[:, 0], local[:, 2]])
    turn = Rotation.from_matrix(body.T @ enu_R_ned @ ned_R_body.as_matrix())
    assert np.degrees(turn.magnitude()) < 0.01


def test_a_picture_straight_down_with_its_top_to_the_north_has_no_angles():
    down = np.column_stack([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
    assert pix4d_angles_deg(down) == pytest.approx((0, 0, 0))


@pytest.mark.slow
def test_an_image_folder_keeps_pixels_and_other_metadata(tmp_path, data_dir):
    folder = tmp_path / "stills"
    folder.mkdir()
    for file in sorted((data_dir / "stills").glob("*.jpg"))[:2]:
        shutil.copy(file, folder)
    (folder / "frame_times.csv").write_text("frame,t_s\n0,0\n1,2\n")
    run = make_solution(np.array([0.0, 2.0]), np.tile(np.eye(4), (2, 1, 1)), recording=folder)
    out = exported(run, tmp_path, "exif", "out")
    for file in folder.glob("*.jpg"):
        with Image.open(file) as old, Image.open(out / file.name) as new:
            assert np.array_equal(np.asarray(old), np.asarray(new))
        old, new = tags_of(file), tags_of(out / file.name)
        assert str(new["Image Make"]) == str(old["Image Make"]) == "SIYIKEJI"
        assert number(new["GPS GPSLatitude"]) == pytest.approx(49.0)
        assert float(new["GPS GPSAltitude"].values[0]) == 100.0


def test_names_are_those_of_the_folder_s_images(tmp_path):
    folder = tmp_path / "pictures"
    folder.mkdir()
    for name in ("b.png", "a.jpg"):
        Image.new("RGB", (64, 48)).save(folder / name)
    (folder / "frame_times.csv").write_text("file,t_s\nb.png,0\na.jpg,2\n")
    run = make_solution(np.array([0.0, 2.0]), np.tile(np.eye(4), (2, 1, 1)), recording=folder)
    out = exported(run, tmp_path, "exif", "out")
    assert sorted(file.name for file in out.glob("*.jpg")) == ["a.jpg", "b.jpg"]  # PNG becomes JPEG
    table = exported(run, tmp_path, "csv", "a.csv", columns=("image",))
    assert table.read_text().split() == ["image", "b.png", "a.jpg"]


def test_without_its_video_the_remedy_is_said(true_run, tmp_path):
    with pytest.raises(RunFolderError, match=r"no frames to export .*--images"):
        exported(replace(true_run, recording=tmp_path / "gone"), tmp_path, "exif", "out")
    assert not (tmp_path / "out").exists()


def test_what_is_no_jpeg_is_refused():
    with pytest.raises(VideoError, match="not a JPEG file"):
        with_metadata(b"\x89PNG....", Image.Exif(), "")

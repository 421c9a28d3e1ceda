"""Folders of pictures: a drone's with EXIF, and those that vgps wrote itself."""

import shutil
from datetime import UTC, datetime

import numpy as np
import pytest
from PIL import Image
from user_files import write_pictures

from vgps.crs import egm96
from vgps.errors import VideoError
from vgps.model import FixClass
from vgps.readers.recording import open_recording
from vgps.readers.video.exif import exif_fixes, picture_times, read_taken

CAMERA = "model: pinhole\nwidth: {}\nheight: {}\nfx: 1900\nfy: 1900\ncx: {}\ncy: {}\n"


def test_a_drone_s_pictures_are_a_recording(data_dir, tmp_path):
    folder = tmp_path / "stills"
    shutil.copytree(data_dir / "stills", folder)
    (folder / "camera.yaml").write_text(CAMERA.format(2560, 1440, 1280, 720))
    found = open_recording(folder)
    np.testing.assert_allclose(found.video.times_s, [0, 3, 6, 8, 11, 14], atol=1.01)
    assert found.video.files[0].name == "IMG_0004.jpg"
    # degrees, minutes, seconds by hand: 14 32 13.6662, 121 22 23.5754
    assert found.gps.latitude_deg[0] == pytest.approx(14.5371295, abs=1e-7)
    assert found.gps.longitude_deg[0] == pytest.approx(121.3732154, abs=1e-7)
    assert found.gps.height_m[0] == pytest.approx(390.583 + egm96().height_m(14.5371, 121.3732), abs=0.01)
    assert set(found.gps.fix_class) == {FixClass.SINGLE}
    assert found.rig.video_start_utc is None  # the camera's clock names no zone


@pytest.fixture(scope="module")
def pictures(recording, tmp_path_factory):
    """Every frame of the simulated recording, with its true pose written into it."""
    folder = tmp_path_factory.mktemp("pictures")
    write_pictures(recording, folder / "walk")
    return folder


@pytest.mark.slow
def test_what_is_written_comes_back(pictures, recording):
    found, true = open_recording(pictures / "walk"), open_recording(recording)
    np.testing.assert_allclose(found.video.times_s, true.video.times_s, atol=2e-6)
    assert abs((found.rig.video_start_utc - true.rig.video_start_utc).total_seconds()) < 1e-5
    assert found.gps.t_s[0] == 0.0 and found.gps.sigma_m[0, 0] == pytest.approx(0.01, abs=1e-4)


@pytest.mark.slow
def test_the_exif_of_a_picture_is_read_once(pictures, monkeypatch):
    opened = []

    def counting(path):
        opened.append(path)
        return read_taken(path)

    monkeypatch.setattr("vgps.readers.video.images.read_taken", counting)
    found = open_recording(pictures / "walk")
    assert len(found.gps) == len(found.video.files) == len(opened) == len(set(opened))


def picture(path, **tags):
    exif = Image.Exif()
    details = {"taken": 0x9003, "sub": 0x9291, "zone": 0x9011}
    exif.get_ifd(0x8769).update({details[name]: value for name, value in tags.items()})
    Image.new("RGB", (8, 8)).save(path, exif=exif)
    return path


def test_times_with_fractions_and_zones(tmp_path):
    a = picture(tmp_path / "a.jpg", taken="2026:05:01 11:30:12", sub="25", zone="+02:00")
    b = picture(tmp_path / "b.jpg", taken="2026:05:01 11:30:12", sub="75", zone="+02:00")
    assert read_taken(a).utc == datetime(2026, 5, 1, 9, 30, 12, 250000, tzinfo=UTC)
    times = picture_times(tmp_path, [read_taken(b), read_taken(a)])
    assert times.t_s.tolist() == [0.0, 0.5] and times.files == ("a.jpg", "b.jpg")


def test_pictures_of_one_second_share_it(tmp_path):
    taken = [
        read_taken(picture(tmp_path / f"{k}.jpg", taken=f"2026:05:01 11:30:{s:02}"))
        for k, s in enumerate([1, 1, 1, 2, 4, 4])
    ]
    np.testing.assert_allclose(picture_times(tmp_path, taken).t_s, [0, 1 / 3, 2 / 3, 1, 3, 3.5])


def test_pictures_without_times_are_refused(tmp_path):
    files = [picture(tmp_path / "a.jpg"), picture(tmp_path / "b.jpg", taken="2026:05:01 11:30:12")]
    with pytest.raises(VideoError, match=r"1 of 2 images without a time; .*; add frame_times\.csv"):
        picture_times(tmp_path, [read_taken(file) for file in files])


@pytest.mark.slow
def test_dji_s_rtk_is_in_its_xmp(tmp_path, pictures):
    (first, *_) = sorted((pictures / "walk").glob("*.jpg"))
    values = {"RtkFlag": 50, "RtkStdLon": 0.011, "RtkStdLat": 0.012, "RtkStdHgt": 0.03}
    xmp = " ".join(f'drone-dji:{key}="{value}"' for key, value in values.items()).encode()
    file = tmp_path / "dji.jpg"
    data = first.read_bytes()
    at = data.index(b"http://ns.adobe.com/xap")
    file.write_bytes(data[: at + 29] + xmp + data[at + 29 + len(xmp) :])
    taken = read_taken(file)
    assert taken.fix.fix_class is FixClass.RTK_FIX and not taken.above_sea
    assert taken.fix.sigma_m == (0.011, 0.012, 0.03)
    raw = exif_fixes([read_taken(file)], np.zeros(1))
    assert raw.notes == [] and raw.fixes[0].height_m == taken.fix.height_m


def test_a_picture_without_a_position_gives_no_fix(tmp_path):
    file = picture(tmp_path / "a.jpg", taken="2026:05:01 11:30:12")
    assert exif_fixes([read_taken(file)], np.zeros(1)).fixes == []
    (tmp_path / "b.jpg").write_bytes(b"rubbish")
    assert read_taken(tmp_path / "b.jpg").fix is None

"""Videos of GoPros as recordings: made ones, and a real walk with a MAX."""

import logging
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from clips import write_clip
from gpmf_bytes import ROW, device, doppler_speeds, encode, gps5, shutter, stream, telemetry, text, walk

from vgps.errors import GpsLogError, RecordingError, VideoError
from vgps.geodesy import to_enu
from vgps.model import FixClass, GeodeticPoint
from vgps.readers import sources
from vgps.readers.gopro.gpmf import read_gpmf
from vgps.readers.gopro.sensors import (
    GYRO_R_CAMERA,
    gopro_exposures,
    picture_rotations,
    read_gopro_gyro,
)
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.recording import open_recording

CAMERA = "model: pinhole\nwidth: 64\nheight: 48\nfx: 50\nfy: 50\ncx: 32\ncy: 24\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_clip(tmp_path / "GX010042.MP4")
    (tmp_path / "camera.yaml").write_text(CAMERA)
    return tmp_path


@pytest.fixture
def with_telemetry(monkeypatch):
    """Let videos have the given telemetry."""

    def tell(found):
        monkeypatch.setattr(sources, "read_gpmf", lambda path: replace(found, path=Path(path)))
        monkeypatch.setattr(
            "vgps.readers.video_gps.find.read_gpmf", lambda path: replace(found, path=Path(path))
        )

    return tell


def test_a_video_alone_is_a_recording_with_gps_gyro_and_exposure(folder, with_telemetry):
    about = text("ORIN", "XYZ")
    spin = stream(encode("GYRO", "s", [[1, 2, 3]] * 10), about, stamp_us=500_000)
    with_telemetry(
        telemetry(device("HERO9", shutter(500_000, 0.004), gps5([ROW] * 4, 3, 154, 600_000), spin))
    )
    opened = open_recording(folder / "GX010042.MP4")
    np.testing.assert_allclose(opened.gps.t_s, [0.1, 0.35, 0.6, 0.85])
    assert opened.gps.source == folder / "GX010042.MP4"
    np.testing.assert_allclose(opened.gyro.t_s, np.arange(10) / 10)
    assert opened.rig.exposure_s == pytest.approx(0.004)
    np.testing.assert_array_equal(opened.rig.gyro_R_camera, GYRO_R_CAMERA)


def test_a_videos_metadata_are_read_once(folder, with_telemetry, monkeypatch):
    with_telemetry(walk())
    told, calls = sources.read_gpmf, []
    for place in ("vgps.readers.sources.read_gpmf", "vgps.readers.video_gps.find.read_gpmf"):
        monkeypatch.setattr(place, lambda path: calls.append(path) or told(path))
    assert len(open_recording(folder / "GX010042.MP4").gps) == 8
    assert calls == [folder / "GX010042.MP4"]


def test_files_take_precedence_over_the_videos_metadata(folder, with_telemetry):
    with_telemetry(walk())
    (folder / "gps.csv").write_text(
        "t_s,latitude_deg,longitude_deg,height_m,fix_class\n0.5,49,8,100,rtk_fix\n"
    )
    (folder / "gyro.csv").write_text("t_s,wx_rad_s,wy_rad_s,wz_rad_s\n0,0,0,1\n0.1,0,0,1\n")
    (folder / "rig.yaml").write_text("exposure_s: 0.5\n")
    opened = open_recording(folder / "GX010042.MP4")
    assert opened.gps.fix_class == ("rtk_fix",)
    assert opened.gyro.source.name == "gyro.csv"
    assert opened.rig.exposure_s == 0.5 and opened.rig.gyro_R_camera is None


def test_a_camera_without_a_fix_is_opened_without_gps_and_a_warning(folder, with_telemetry, caplog):
    with_telemetry(telemetry(device("HERO9", shutter(0), gps5([ROW] * 4, 0, 9999, 0))))
    with caplog.at_level(logging.WARNING):
        assert open_recording(folder / "GX010042.MP4").gps is None
    assert "never had a fix; continuing without GPS" in caplog.text
    # but who names it is told
    with pytest.raises(GpsLogError, match=r"no fix with a position \(4 of 4 GPS samples had no fix\)"):
        open_recording(folder / "GX010042.MP4", gps="GX010042.MP4")


def test_a_video_without_metadata_named_as_log_is_refused(folder):
    assert open_recording(folder / "GX010042.MP4").gps is None
    with pytest.raises(GpsLogError, match=r"GX010042\.MP4: a video without GPS"):
        open_recording(folder / "GX010042.MP4", gps="GX010042.MP4")


def test_a_drones_subtitles_beside_its_video_are_found(folder, caplog):
    (folder / "GX010042.SRT").write_text(
        "1\n00:00:00,000 --> 00:00:01,000\n[latitude: 48.1] [longitude: 11.5] [abs_alt: 500.0]\n\n"
    )
    assert open_recording(folder / "GX010042.MP4").gps.source.name == "GX010042.SRT"
    (folder / "GX010042.SRT").write_text("1\n00:00:00,000 --> 00:00:01,000\nHello\n\n")
    # captions of a flight without GPS are no reason to stop, unless they are named as the log
    assert open_recording(folder / "GX010042.MP4").gps is None
    assert "none with a position" in caplog.text and "continuing without GPS" in caplog.text
    with pytest.raises(GpsLogError, match="none with a position"):
        open_recording(folder / "GX010042.MP4", gps="GX010042.SRT")


def test_the_walk_with_a_max(data_dir):
    opened = open_recording(data_dir / "gopro_walk")
    assert len(opened.video.times_s) == 315
    assert opened.gps is not None and opened.gyro is not None
    assert len(opened.gps) == 191 and set(opened.gps.fix_class) == {FixClass.SINGLE}
    assert opened.gps.hdop[0] == 1.54
    # STMP of the first sample after that of the first frame
    assert opened.gps.t_s[0] == pytest.approx(0.101994 - 0.085608, abs=1e-9)
    # a stabilised picture: half way between frames
    assert opened.gyro.t_s[0] == pytest.approx(0.5 / 29.97, abs=1e-6)
    assert np.median(np.diff(opened.gps.t_s)) == pytest.approx(1 / 18.2, rel=0.02)
    assert np.median(np.diff(opened.gyro.t_s)) == pytest.approx(1 / 29.97, rel=0.01)
    assert abs(opened.gps.t_s[-1] - opened.video.times_s[-1]) < 0.1
    assert np.diff(opened.gps.t_s).min() > 0.05
    assert opened.rig.exposure_s == pytest.approx(1 / 1600, rel=0.7)


def test_the_walks_positions_agree_with_its_doppler_speeds(data_dir):
    found = read_gpmf(data_dir / "gopro_walk/video.mp4")
    gps = read_gps_log(found.path)
    t_s, speed = doppler_speeds(found)
    place = gps.latitude_deg, gps.longitude_deg, gps.height_m
    enu = to_enu(GeodeticPoint(*(column[0] for column in place)), *place)
    way = float(np.hypot(*(enu[-1] - enu[0])[:2]))
    assert way == pytest.approx(np.trapezoid(speed[:, 0], t_s), rel=0.1)
    assert speed[:, 1].mean() == pytest.approx(1.21, abs=0.01)


def test_the_walks_axes_by_gravity_and_by_its_own_orientation(data_dir):
    """Held upright: up is Z. Body rates of CORI are the gyro's in camera axes."""
    found = read_gpmf(data_dir / "gopro_walk/video.mp4")
    pulled = np.concatenate([block.samples for block in found.sensors["ACCL"]]).mean(axis=0)
    x, minus_z, y = pulled  # XzY
    up_in_camera = GYRO_R_CAMERA.T @ np.array([x, y, -minus_z]) / np.linalg.norm(pulled)
    np.testing.assert_allclose(up_in_camera, [0, -1, 0], atol=0.15)
    gyro_log = read_gopro_gyro(found)
    times, _ = gopro_exposures(found)
    camera = np.concatenate([block.samples for block in found.sensors["CORI"]])
    # small turns: twice the vector part of the quaternion's change, over the frame's time
    rates = 2 * np.diff(camera[:, 1:], axis=0) / np.diff(times)[:, None]
    kernel = np.ones(7) / 7
    smooth = np.column_stack([np.convolve(axis, kernel, "same") for axis in gyro_log.rate_rad_s.T])
    middle = (times[1:] + times[:-1]) / 2
    there = np.column_stack([np.interp(middle, gyro_log.t_s, axis) for axis in smooth.T]) @ GYRO_R_CAMERA
    for k in range(3):
        assert np.corrcoef(-rates[:, k], there[:, k])[0, 1] > 0.8


def test_the_walks_picture_turned_as_its_two_orientations_say(data_dir):
    times, first_R_camera, _ = picture_rotations(read_gpmf(data_dir / "gopro_walk/video.mp4"))
    assert len(times) == 316
    np.testing.assert_allclose(
        first_R_camera @ first_R_camera.transpose(0, 2, 1), [np.eye(3)] * 316, atol=1e-9
    )
    # stabilised: a frame turns the picture by half a degree at most in a quiet walk
    step = np.einsum("nji,njk->nik", first_R_camera[:-1], first_R_camera[1:])
    angle = np.degrees(np.arccos(np.clip((np.trace(step, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    assert np.median(angle) < 0.5


@pytest.mark.slow
def test_the_walk_damaged_in_one_payload_keeps_the_others(data_dir, tmp_path):
    whole = bytearray((data_dir / "gopro_walk/video.mp4").read_bytes())
    at = [index for index in range(len(whole)) if whole.startswith(b"GPS5l\x14", index)]
    assert len(at) == 11
    struct.pack_into(">H", whole, at[4] + 6, 60_000)  # claims more samples than there are
    (tmp_path / "video.mp4").write_bytes(whole)
    log = read_gps_log(tmp_path / "video.mp4")
    assert log.skipped == ("1 damaged payload of GoPro metadata skipped",)
    assert 170 < len(log) < 180
    assert np.diff(log.t_s).max() == pytest.approx(1.0, abs=0.1)


def test_the_truncated_walk_is_refused(data_dir, tmp_path):
    whole = (data_dir / "gopro_walk/video.mp4").read_bytes()
    (tmp_path / "video.mp4").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "camera.yaml").write_text((data_dir / "gopro_walk/camera.yaml").read_text())
    with pytest.raises((VideoError, RecordingError), match=r"video\.mp4") as error:
        open_recording(tmp_path)
    assert "\n" not in str(error.value)
    with pytest.raises(RecordingError, match=r"video\.mp4: cannot be read"):
        read_gps_log(tmp_path / "video.mp4")


def test_a_video_is_no_log_of_its_folder(data_dir):
    assert gps_format(data_dir / "gopro_walk/video.mp4") is None

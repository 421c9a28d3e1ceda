"""Chapters of a GoPro: one video with one clock, and one telemetry."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from clips import checked_frames, shade, write_clip
from gpmf_bytes import ROW, device, gps5, shutter, telemetry

from vgps.errors import VideoError
from vgps.readers.gopro import chapters
from vgps.readers.gopro.chapters import ChapteredVideo, chapters_of
from vgps.readers.gopro.sensors import read_gopro_gps
from vgps.readers.recording import open_recording
from vgps.readers.sources import open_video


@pytest.fixture
def folder(tmp_path):
    for name in ("GX010042.MP4", "GX020042.MP4", "GX030042.MP4", "GX010043.MP4"):
        write_clip(tmp_path / name)
    return tmp_path


def test_chapters_follow_one_another(folder):
    video = open_video(folder / "GX010042.MP4")
    assert isinstance(video, ChapteredVideo) and video.path.name == "GX010042.MP4"
    np.testing.assert_allclose(video.times_s, np.arange(30) / 10)
    frames = checked_frames(video)
    assert int(np.median(frames[12].gray[24:])) == pytest.approx(int(np.median(frames[2].gray[24:])))
    wanted = dict(video.pictures([3, 14, 29]))
    assert list(wanted) == [3, 14, 29]
    assert np.median(wanted[14][24:]) == pytest.approx(shade(4), abs=4)
    assert video.warnings[0].startswith("GX010042.MP4, GX020042.MP4, GX030042.MP4 were read as the chapters")


def test_chapters_of_a_turned_camera_know_it(tmp_path):
    for name in ("GX010042.MP4", "GX020042.MP4"):
        write_clip(tmp_path / name, rotation=90)
    assert open_video(tmp_path / "GX010042.MP4").quarter_turns == 1


def test_names_of_all_models(folder):
    assert [file.name for file in chapters_of(folder / "GX010043.MP4")] == ["GX010043.MP4"]
    assert [file.name for file in chapters_of(folder / "GX020042.MP4")] == ["GX020042.MP4"]
    for name in ("GOPR0007.mp4", "GP010007.mp4", "GP020007.mp4", "GP040007.mp4"):
        shutil.copy(folder / "GX010043.MP4", folder / name)
    found = [file.name for file in chapters_of(folder / "GOPR0007.mp4")]
    assert found == ["GOPR0007.mp4", "GP010007.mp4", "GP020007.mp4"]


def test_a_folder_with_one_recording_needs_no_other_name(folder):
    (folder / "GX010043.MP4").unlink()
    assert len(open_recording(folder).video.times_s) == 30


def test_a_chapter_of_another_size_is_refused(folder):
    write_clip(folder / "GX020042.MP4", draw=lambda index: np.zeros((32, 32, 3), np.uint8))
    with pytest.raises(VideoError, match=r"GX020042\.MP4: a chapter of 32 x 32; expected 64 x 48 as in GX01"):
        open_video(folder / "GX010042.MP4")


@pytest.mark.parametrize("again", [True, False], ids=["stamps begin anew", "stamps go on"])
def test_fixes_of_all_chapters_are_on_one_clock(folder, monkeypatch, again):
    def of(path):
        number = int(path.name[2:4]) - 1
        begin_us = 500_000 + (0 if again else number * 1_000_000)
        found = telemetry(device("Hero9", shutter(begin_us), gps5([ROW] * 4, 3, 154, begin_us + 100_000)))
        return replace(found, path=path)

    monkeypatch.setattr(chapters, "read_gpmf", of)
    fixes = read_gopro_gps(open_video(folder / "GX010042.MP4").telemetry()).fixes
    assert len(fixes) == 12
    # four in a second, 0.1 s after the frames of each chapter of a second
    np.testing.assert_allclose([fix.t_s for fix in fixes[::4]], [0.1, 1.1, 2.1], atol=1e-6)

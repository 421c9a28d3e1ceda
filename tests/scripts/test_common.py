"""What scripts share: tables, times, scenes, truths, the endless drive and the simulated receiver."""

import socket
import time
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from clips import write_clip
from solutions import NORTH_R_CAMERA, make_poses, make_solution

import vgps
from scripts.common.drives import VideoSection
from scripts.common.fix_server import FixServer, sentences
from scripts.common.markdown import LiveTable, mean_and_range, table
from scripts.common.ping_pong import PingPong
from scripts.common.recordings import read_truth, true_poses
from scripts.common.scenes import half_size, shortened
from scripts.common.stopwatch import stopwatch
from vgps.errors import RunFolderError, TrajectoryError
from vgps.model import FixClass, GeodeticPoint
from vgps.readers.gps import read_gps_log
from vgps.readers.video.video_file import VideoFile
from vgps.simulate import SCENES
from vgps.solution import Trajectory
from vgps.writers.tum import write_tum

ORIGIN = GeodeticPoint(49.0, 8.0, 100.0)


def test_tables_and_ranges(capsys):
    assert table(["a", "b"], [["1", "2"]]) == "| a | b |\n|---|---|\n| 1 | 2 |"
    assert mean_and_range([1.0, 2.0, 6.0]) == "3.000 (1.000-6.000)"
    assert mean_and_range([1.0, 2.0, 6.0], digits=1, middle=2.0) == "2.0 (1.0-6.0)"
    assert mean_and_range([0.5]) == "0.500"
    live = LiveTable("a", "b")
    assert capsys.readouterr().out == ""
    live.add("1", "2")
    live.add("3", "4")
    assert capsys.readouterr().out == "| a | b |\n|---|---|\n| 1 | 2 |\n| 3 | 4 |\n"


def test_a_stopwatch_tells_waiting_from_working():
    with stopwatch() as elapsed:
        time.sleep(0.05)
    assert elapsed.wall_s > 0.049
    assert elapsed.cpu_s < 0.04 and elapsed.thread_s < 0.04


def test_a_scene_in_small_images_shows_the_same():
    scene, small = SCENES["walk"], half_size(SCENES["walk"])
    assert (small.width, small.height) == (scene.width / 2, scene.height / 2)
    assert small.focal_px / small.width == scene.focal_px / scene.width
    cut = shortened(scene, 10.0)
    assert cut.frames == 10 * scene.fps and cut.speed[:-1] == tuple(k for k in scene.speed if k[0] < 10.0)


@pytest.fixture
def drive(tmp_path):
    """A run of two seconds to the north, and its recording's truth, whose clock is ten seconds ahead."""
    t_s = np.arange(21) / 10
    poses = make_poses(np.column_stack([0 * t_s, 5 * t_s, 0 * t_s]), NORTH_R_CAMERA)
    (tmp_path / "rig.yaml").write_text("video_start_s: 10.0\nworld_origin: [49.0, 8.0, 100.0]\n")
    write_tum(Trajectory(t_s + 10.0, poses), tmp_path / "truth.tum")
    return make_solution(t_s=t_s, world_T_camera=poses, recording=tmp_path, world_origin=ORIGIN)


def test_a_truth_is_on_the_video_s_clock(drive):
    assert read_truth(drive.recording).t_s[0] == pytest.approx(0.0)
    np.testing.assert_allclose(true_poses(drive, drive.recording), drive.world_T_camera, atol=1e-6)


def test_a_truth_is_in_the_run_s_world(drive):
    higher = replace(drive, world_origin=GeodeticPoint(49.0, 8.0, 102.0))
    moved = true_poses(higher, drive.recording)[:, :3, 3] - drive.world_T_camera[:, :3, 3]
    np.testing.assert_allclose(moved, np.tile([0.0, 0.0, -2.0], (21, 1)), atol=1e-4)


def test_a_run_without_a_truth_is_refused(drive, tmp_path):
    with pytest.raises(RunFolderError, match="give --truth"):
        true_poses(replace(drive, recording=None), tmp_path)
    longer = replace(drive, t_s=drive.t_s + 0.2)
    with pytest.raises(TrajectoryError, match=r"runs from 0\.00 to 2\.00 s; expected .* 0\.20 to 2\.20 s"):
        true_poses(longer, tmp_path)


@pytest.fixture(scope="module")
def endless(recording):
    return PingPong(vgps.open_recording(recording), section=10)


def test_a_section_is_played_forwards_and_backwards(endless):
    there, back = endless.frame(3), endless.frame(15)  # of 10 frames: 0 .. 9 .. 0
    assert back[0] - there[0] == pytest.approx(12 * endless.interval_s)
    np.testing.assert_array_equal(there[1], back[1])
    np.testing.assert_array_equal(there[2], back[2])
    assert (endless.frame(18)[1] == endless.images[0]).all()


def test_an_endless_drive_is_a_recording_like_any_other(endless):
    made = endless.recording(40)
    frames = list(made.video.frames())
    assert len(frames) == len(made.video.times_s) == 40
    np.testing.assert_allclose([frame.t_s for frame in frames], made.video.times_s)
    assert made.gps is not None and len(made.gps) == int(39 * endless.interval_s)
    assert endless.fix_error_m > 0


def test_a_receiver_sends_to_who_is_connected():
    server = FixServer()
    try:
        fix = vgps.Fix(1.5, 49.01, 8.41, 160.5, FixClass.RTK_FLOAT, 0)
        server.send(fix)  # nobody there
        with socket.create_connection(("127.0.0.1", server.port), timeout=5) as client:
            wait_until(lambda: server.connected)
            server.send(fix)
            assert client.recv(4096) == sentences(fix, server.start_utc)
        port = server.port
        server.stop()
        with pytest.raises(OSError):
            socket.create_connection(("127.0.0.1", port), timeout=1)
        server.start()
        assert server.port == port
    finally:
        server.stop()


def wait_until(condition, seconds=5.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_sentences_are_read_as_they_were_meant(tmp_path):
    start = datetime(2026, 1, 1, 12, tzinfo=UTC)
    fix = vgps.Fix(1.5, 49.01, 8.41, 160.5, FixClass.RTK_FLOAT, 0)
    log = tmp_path / "gps.nmea"
    log.write_bytes(sentences(fix, start) + sentences(fix._replace(t_s=2.5), start, valid=False))
    found = read_gps_log(log)
    assert len(found) == 1 and found.fix_class == (FixClass.RTK_FLOAT,)
    assert found.latitude_deg[0] == pytest.approx(49.01, abs=1e-8)
    assert found.height_m[0] == pytest.approx(160.5, abs=1e-3)


def test_a_section_of_a_video_has_its_own_clock_and_frames(tmp_path):
    whole = VideoFile(write_clip(tmp_path / "whole.mp4", frames=6))
    section = VideoSection(whole, 2, 4)
    np.testing.assert_allclose(section.times_s, whole.times_s[2:5] - whole.times_s[2])
    given, kept = list(whole.frames())[2:5], list(section.frames())
    assert [frame.index for frame in kept] == [0, 1, 2]
    np.testing.assert_allclose([frame.t_s for frame in kept], section.times_s)
    for one, other in zip(given, kept, strict=True):
        np.testing.assert_array_equal(one.gray, other.gray)
    assert (section.path, section.width, section.height) == (whole.path, whole.width, whole.height)

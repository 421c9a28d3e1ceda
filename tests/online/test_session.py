"""Cameras and receivers over real sockets, and the verb as a user runs it."""

import json
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import av
import numpy as np
import pytest
from live_sources import TcpServer, epochs_of, mpeg_ts, paced, until

import vgps
from vgps.errors import VideoError
from vgps.model import FixClass
from vgps.online import session
from vgps.online.sources.gps_messages import StreamedFix
from vgps.online.sources.gps_source import ReceivedFix
from vgps.online.sources.live_feed import VideoClock
from vgps.online.sources.video_source import VideoSource
from vgps.readers.gps_formats.fixes import Clock, Fix
from vgps.readers.run_folder import read_run


@pytest.fixture(scope="module")
def stream(recording, tmp_path_factory):
    """The recording's video as a transport stream."""
    return mpeg_ts(recording / "video.mp4", tmp_path_factory.mktemp("stream") / "video.ts")


def test_a_recording_with_a_drones_fixes_flies(recording, monkeypatch):
    opened = vgps.open_recording(recording)
    opened = replace(opened, gps=replace(opened.gps, airborne=True))

    def first_step(_camera, _rig, config, **_):
        raise InterruptedError(config.start.airborne)

    monkeypatch.setattr(session, "open_recording", lambda *_, **__: opened)
    monkeypatch.setattr(session, "OnlineSmoother", first_step)
    with pytest.raises(InterruptedError, match="yes"):
        session.pose_recording(recording, session.OnlineOptions(config=vgps.Config()))


@pytest.mark.parametrize("live", [True, False])
def test_poses_of_a_live_camera_wait_for_no_fit(recording, monkeypatch, live):
    def first_step(_camera, _rig, config, **_):
        raise InterruptedError(f"repeatable: {config.online.repeatable}")

    monkeypatch.setattr(session, "VideoSource", lambda _: SimpleNamespace(live=live))
    monkeypatch.setattr(session, "OnlineSmoother", first_step)
    options = session.OnlineOptions(config=vgps.Config(), camera=recording / "camera.yaml")
    with pytest.raises(InterruptedError, match=f"repeatable: {not live}"):
        session.pose_live("camera", None, options)


def received(t_s, unix_s, clock=Clock.UTC):
    return ReceivedFix(StreamedFix(clock, Fix(t_s, 49.0, 8.0, 100.0, FixClass.RTK_FIX, 1)), unix_s)


def test_fixes_are_placed_by_the_start_of_the_video():
    fix, note = VideoClock(1000.0, live=True).fix(received(1003.5, 1003.9))
    assert fix.t_s == 3.5 and note is None


def test_with_a_wrong_clock_fixes_get_their_times_of_arrival():
    clock = VideoClock(5000.0, live=True)
    fix, note = clock.fix(received(1003.5, 5003.9))
    assert fix.t_s == pytest.approx(3.9) and note is not None and "by 4000.4 s" in note
    fix, note = clock.fix(received(1004.5, 5005.2))
    assert fix.t_s == pytest.approx(4.9) and note is None  # the first arrival says how far


def test_a_time_of_day_is_of_the_nearest_day():
    day = 86400.0
    fix, _ = VideoClock(3 * day - 10.0, live=False).fix(received(5.0, 0.0, Clock.TIME_OF_DAY))
    assert fix.t_s == 15.0


@pytest.mark.slow
def test_a_file_gives_every_frame_at_its_time(recording):
    source, times = VideoSource(str(recording / "video.mp4")), []
    assert not source.live
    while not source.ended:
        frame = source.next(0.1)
        if frame is not None:
            times.append(frame.t_s)
    with av.open(str(recording / "video.mp4")) as container:
        own = [frame.time for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.array(own) - own[0], atol=1e-6)
    source.close()


@pytest.mark.slow
def test_a_camera_that_is_restarted_goes_on_with_later_times(brief, tmp_path):
    stream = mpeg_ts(brief / "video.mp4", tmp_path / "video.ts")
    server = TcpServer(paced(stream.read_bytes(), 3.0, 45))
    source = VideoSource(f"tcp://127.0.0.1:{server.port}")
    frames, notes, at = [], [], []

    def more():
        frame = source.next(0.05)
        notes.extend(source.notes())
        at.extend([len(frames)] * (len(notes) == 2 and not at))
        frames.extend([frame] if frame is not None else [])
        return at and len(frames) > at[0] + 10

    until(more, 40.0)
    source.close()
    server.close()
    times = np.array([frame.t_s for frame in frames])
    assert source.live and server.clients >= 2 and at[0] > 5
    assert "dropped" in notes[0] and "connected again" in notes[1]
    assert times[0] == 0.0 and (np.diff(times) > 0).all()
    # on the clock of arrival throughout, but for what a busy machine is late
    late = np.array([frame.arrival_s for frame in frames]) - times
    assert np.ptp(late) < 2.0
    assert frames[0].gray.shape == (240, 320) and frames[0].gray.std() > 5


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "/dev/video77", "no/such/file.mp4"])
def test_a_video_that_cannot_be_opened_is_an_error(address):
    with pytest.raises(VideoError, match="cannot be opened"):
        VideoSource(address)


def command(*words):
    return [sys.executable, "-m", "vgps", "online", *map(str, words)]


def records(text):
    return [json.loads(line) for line in text.splitlines()]


@pytest.mark.slow
def test_the_verb_on_a_recording(brief, tmp_path, vgps_verb):
    out = tmp_path / "run"
    code, told, errors = vgps_verb("online", brief, "--out", out)
    assert code == 0, errors
    lines = records(told)
    poses = [line for line in lines if line["type"] == "pose"]
    assert [pose["frame"] for pose in poses] == list(range(45))
    assert poses[0]["state"] == "starting" and poses[0]["global"] is None
    last = poses[-1]
    assert last["state"] == "tracked" and 0.0 <= last["global"]["heading_deg"] < 360.0
    assert {"east_m", "qw", "latitude_deg", "height_m"} <= set(last["local"]) and last["latency_s"] > 0
    assert 0.0 < last["global"]["sigma_east_m"] < 1.0 and 0.0 < last["global"]["sigma_rot_up_deg"] < 10.0
    assert {line["event"] for line in lines if line["type"] == "event"} >= {"aligned", "fix"}
    run = read_run(out)
    assert len(run.t_s) == 45 and run.georeferenced and run.fixes is not None and run.fixes.used.all()
    np.testing.assert_allclose(run.world_T_camera[-1, 0, 3], last["global"]["east_m"], atol=0.2)
    np.testing.assert_allclose(run.sigma_position_m[-1, 0], last["global"]["sigma_east_m"], atol=1e-4)
    assert np.isnan(run.sigma_position_m[0]).all()  # there was no pose in the world yet


@pytest.mark.slow
def test_ctrl_c_ends_with_a_whole_run(recording, tmp_path):
    out = tmp_path / "run"
    words = command(recording, "--realtime", "--out", out)
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            record = json.loads(line)
            if record["type"] == "pose" and record["state"] == "tracked":
                process.send_signal(signal.SIGINT)
                break
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    run = read_run(out)
    assert 20 < len(run.t_s) < 90 and np.isfinite(run.world_T_camera).all()


@pytest.mark.slow
def test_the_verb_on_a_camera_and_a_receiver(recording, stream, tmp_path):
    epochs = epochs_of((recording / "gps.nmea").read_bytes())
    shown = threading.Event()

    def camera(connection):
        shown.set()
        paced(stream.read_bytes(), 9.0, 135)(connection)

    def receiver(connection):
        shown.wait(60.0)
        for epoch in epochs:
            connection.sendall(epoch)
            time.sleep(1.5)

    cameras, receivers = TcpServer(camera), TcpServer(receiver)
    video, gps = (f"tcp://127.0.0.1:{server.port}" for server in (cameras, receivers))
    words = command("--video", video, "--gps", gps, "--out", tmp_path / "run")
    words += ["--camera", str(recording / "camera.yaml")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            lines.append(json.loads(line))
            posed = sum(record["type"] == "pose" for record in lines)
            if posed >= 40:
                process.send_signal(signal.SIGINT)
                break
        _, errors = process.communicate(timeout=120)
    cameras.close()
    receivers.close()
    assert process.returncode == 0, errors
    notes = [record["text"] for record in lines if record.get("event") == "note"]
    assert any("clock differs" in note and "times of arrival" in note for note in notes)
    run = read_run(tmp_path / "run")
    assert len(run.t_s) >= 40 and run.gps is not None and len(run.gps) >= 2


@pytest.mark.slow
def test_the_verb_reads_a_receiver_from_standard_input(brief):
    words = command("--video", brief / "video.mp4", "--gps", "-")
    words += ["--camera", str(brief / "camera.yaml"), "--rig", str(brief / "rig.yaml")]
    log = (brief / "gps.nmea").read_text()
    done = subprocess.run(words, input=log, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = [line for line in records(done.stdout) if line.get("event") == "fix"]
    assert len(told) >= 5 and {line["verdict"] for line in told} == {"used"}


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "--video SOURCE"),
        (["--video", "/dev/video77"], "--camera"),
        (["nowhere"], "no such recording"),
    ],
)
def test_missing_options_are_reported_in_one_line(words, told, vgps_verb):
    code, _, error = vgps_verb("online", *words)
    assert code == 2 and told in error
    assert len(error.strip().splitlines()) == 1 and error.startswith("vgps: ")

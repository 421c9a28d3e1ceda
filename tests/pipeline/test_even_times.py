"""Videos that were converted to another frame rate, or stamped by a computer: patterns, and a real drive."""

from dataclasses import replace

import numpy as np
import pytest
from brief_videos import first_frames
from fewer_features import fewer_features
from hypothesis import given, settings
from hypothesis import strategies as st

import vgps
from scripts.experiments.changed_videos import closest, converted, nearest, shown_at
from vgps.config import Config
from vgps.errors import GeometryError
from vgps.pipeline.even_times import picture_times, with_even_times
from vgps.pipeline.front_end import run_front_end
from vgps.readers.trajectory import read_trajectory
from vgps.readers.video.retimed_video import RetimedVideo
from vgps.runtime.progress import NoProgress
from vgps.smoothing.merging.merge_cameras import CameraMaps


def late_s(count):
    """What a computer may stamp pictures late by."""
    return np.random.default_rng(0).uniform(0.0, 0.08, count)


def repeats_of(shown):
    return np.diff(shown, prepend=-1) == 0


@pytest.mark.parametrize("convert", [converted, nearest, closest])
@pytest.mark.parametrize(("pictures_hz", "frames_hz"), [(25, 30), (24, 30), (10, 15), (10, 27), (24, 60)])
def test_pictures_of_a_converted_video_are_evenly_spaced_again(convert, pictures_hz, frames_hz):
    """All are late by the same: by half a frame at most, or half of what a picture lasts longer than one."""
    picture_s = np.arange(200) / pictures_hz
    shown, at_s = convert(picture_s, frames_hz / pictures_hz)
    repeats = repeats_of(shown)
    found_s, even = picture_times(at_s, repeats, np.ones(len(at_s), bool))
    first = np.flatnonzero(~repeats)
    late_s = found_s[first] - picture_s[shown[first]]
    assert even[first].all() and not even[repeats].any()
    assert np.ptp(late_s) < 1e-3 / frames_hz
    assert np.abs(late_s).max() <= 0.5 / min(frames_hz, 1.0 / (1.0 / pictures_hz - 1.0 / frames_hz)) + 1e-9
    assert np.ptp(at_s[first] - picture_s[shown[first]]) > 0.4 / frames_hz
    assert np.diff(found_s).min() > 0.2 / frames_hz


@pytest.mark.parametrize("share", [0.01, 0.2, 0.6])
def test_pictures_of_a_recorder_that_hangs_now_and_then_keep_their_times(share):
    for seed in range(3):
        repeats = np.random.default_rng(seed).random(300) < share
        repeats[0] = False
        at_s = np.arange(300) / 30.0
        found_s, even = picture_times(at_s, repeats, np.ones(300, bool))
        np.testing.assert_array_equal(found_s, at_s)
        assert not even.any()


def test_where_a_camera_stands_times_stay():
    """Nobody knows which frames of a stop repeat a picture. Pictures before and after it are even."""
    shown, at_s = converted(np.arange(300) / 25.0, 1.2)
    repeats = repeats_of(shown)
    known = (at_s < 4.0) | (at_s > 8.0)
    found_s, even = picture_times(at_s, repeats & known, known)
    np.testing.assert_array_equal(found_s[~known], at_s[~known])
    assert even[~repeats & known].all()
    for part in (at_s < 4.0, at_s > 8.0):
        np.testing.assert_allclose(np.diff(found_s[~repeats & part]), 0.04, atol=1e-9)


def test_where_the_rate_changes_another_stretch_begins():
    picture_s = np.concatenate([np.arange(110) / 25.0, 4.4 + np.arange(100) / 20.0])
    shown, at_s = converted(picture_s, 1.2)
    repeats = repeats_of(shown)
    found_s, even = picture_times(at_s, repeats, np.ones(len(at_s), bool))
    late_s = (found_s - picture_s[shown])[~repeats]
    assert even[~repeats].all() and np.abs(late_s).max() < 0.5 / 30.0


@settings(max_examples=40)
@given(
    st.lists(st.tuples(st.floats(0.2, 0.95), st.integers(2, 80)), min_size=1, max_size=3),
    st.sets(st.integers(0, 240), max_size=4),
    st.sets(st.integers(0, 240), max_size=4),
)
def test_times_increase_and_move_by_a_frame_at_most(rates, hangs, unknown):
    """Whatever the rates, and whatever repeats or is unknown besides."""
    repeats = np.concatenate([np.diff(np.floor(a * np.arange(n)), prepend=-1) == 0 for a, n in rates])
    numbers = np.arange(len(repeats))
    repeats = (repeats | np.isin(numbers, list(hangs))) & (numbers > 0)
    at_s, known = 0.04 * numbers, ~np.isin(numbers, list(unknown)) | repeats
    found_s, even = picture_times(at_s, repeats, known)
    assert np.diff(found_s, append=np.inf).min() > 0.0
    assert np.abs(found_s - at_s).max() <= 0.04 * (1.0 + 1e-9)
    np.testing.assert_array_equal(found_s[~even & ~repeats], at_s[~even & ~repeats])


@pytest.fixture(scope="module")
def drive(data_dir):
    """Its first nine seconds, at ten pictures a second."""
    return first_frames(vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea"), 90)


@pytest.mark.slow
def test_a_converted_video_gives_the_poses_of_its_pictures(drive, data_dir):
    """At 15 frames a second, each with the newest picture: 0.11 m and a NEES of 8 by its time stamps."""
    order = converted(drive.video.times_s, 1.5)
    shown, first = np.unique(order[0], return_index=True)
    solution = vgps.smooth(shown_at(drive, order), fewer_features(100))
    true = read_trajectory(data_dir / "kitti07/truth.tum").world_T_camera[shown]
    error = solution.world_T_camera[first, :3, 3] - true[:, :3, 3]
    assert np.linalg.norm(error, axis=1).mean() < 0.09
    assert np.mean(np.sum((error / solution.sigma_position_m[first]) ** 2, axis=1)) < 4.0
    # before anything has moved nobody knows which frame repeats the first picture; a last one may be missed
    even = np.abs(np.diff(solution.t_s[first[1:]]) - 0.1) < 2e-3
    assert even[:-10].all() and even.mean() > 0.9
    (told,) = [one for one in solution.warnings if "was converted" in one]
    assert "shows about 10 pictures a second in 15 frames" in told
    assert solution.config["sensors"]["frame_time_sigma_s"] == 0.0  # the settings are the user's


@pytest.fixture(scope="module")
def front_end(drive):
    """That of the first three seconds."""
    return run_front_end(first_frames(drive, 30), fewer_features(100), NoProgress())


def again(front_end, shown, monkeypatch, run=lambda recording, *_: recording):
    """What follows if frames show these pictures: the front end or recording, the settings, and whether any
    stage ran again."""
    runs, repeats = [], np.flatnonzero(repeats_of(shown))
    monkeypatch.setattr("vgps.pipeline.even_times.run_front_end", lambda *a: runs.append(a) or run(*a))
    monkeypatch.setattr("vgps.pipeline.even_times._views", lambda one: np.ones(len(one.t_s), bool))
    found = with_even_times(replace(front_end, repeated_frames=repeats), Config(), NoProgress())
    return *found, bool(runs)


@pytest.mark.slow
def test_a_video_as_it_was_recorded_keeps_its_times(front_end):
    config = fewer_features(100)
    assert with_even_times(front_end, config, NoProgress()) == (front_end, config)


@pytest.mark.slow
def test_a_video_that_a_computer_stamped_has_even_times(drive, data_dir):
    """Time stamps up to 0.08 s late: by these poses are off by 0.26 m."""
    t_s = drive.video.times_s
    stamped = replace(drive, video=RetimedVideo(drive.video, t_s + late_s(len(t_s))))
    solution = vgps.smooth(stamped, fewer_features(100))
    true = read_trajectory(data_dir / "kitti07/truth.tum").world_T_camera[: len(t_s)]
    error = solution.world_T_camera[:, :3, 3] - true[:, :3, 3]
    assert np.linalg.norm(error, axis=1).mean() < 0.08
    assert np.mean(np.sum((error / solution.sigma_position_m) ** 2, axis=1)) < 4.0
    np.testing.assert_allclose(np.diff(solution.t_s), 0.1, atol=2e-3)
    (told,) = [one for one in solution.warnings if "even times" in one]
    assert "over which the path is smoother" in told


@pytest.mark.slow
def test_what_all_stamps_are_late_by_is_as_unsure_as_they_are(front_end, monkeypatch):
    monkeypatch.setattr("vgps.pipeline.even_times.run_front_end", lambda recording, *_: recording)
    off_s = late_s(30)
    stamped = replace(front_end, t_s=front_end.t_s + off_s)
    recording, config = with_even_times(stamped, Config(), NoProgress())
    np.testing.assert_allclose(np.diff(recording.video.times_s), 0.1, atol=2e-3)
    assert config.sensors.frame_time_sigma_s == pytest.approx(np.std(off_s), rel=0.1)
    assert recording.video.repeats is None


@pytest.mark.slow
def test_pictures_taken_at_uneven_times_keep_them(drive):
    """Every third of three seconds is missing."""
    t_s, config = drive.video.times_s, fewer_features(100)
    kept = np.flatnonzero(np.arange(30) % 3 != 2)
    front_end = run_front_end(shown_at(drive, (kept, t_s[kept])), config, NoProgress())
    assert with_even_times(front_end, config, NoProgress()) == (front_end, config)


@pytest.mark.slow
def test_a_converted_video_runs_again_at_even_times(front_end, monkeypatch):
    shown = converted(np.arange(60.0), 1.5)[0]
    at_s = np.arange(len(shown)) / 15.0
    recording, config, runs = again(replace(front_end, t_s=at_s), shown, monkeypatch)
    assert runs and config.sensors.frame_time_sigma_s == pytest.approx(0.025)
    repeats = repeats_of(shown)
    np.testing.assert_array_equal(recording.video.repeats, repeats)
    np.testing.assert_allclose(np.diff(recording.video.times_s[~repeats]), 0.1, atol=1e-9)
    assert sum("was converted" in note for note in recording.notes) == 1


@pytest.mark.slow
def test_a_video_of_every_picture_twice_has_even_times_but_may_be_late(front_end, monkeypatch):
    one = replace(front_end, t_s=np.arange(60) / 20.0)
    found, config, runs = again(one, np.arange(60) // 2, monkeypatch)
    assert not runs and found.t_s is one.t_s and config.sensors.frame_time_sigma_s == pytest.approx(0.025)
    for told in (found.warnings, found.recording.notes):
        assert sum("was converted" in note for note in told) == 1


@pytest.mark.slow
def test_a_second_run_without_a_path_leaves_the_first(front_end, monkeypatch):
    def fails(*_):
        raise GeometryError("no map could be started")

    one, shown = replace(front_end, t_s=np.arange(89) / 15.0), converted(np.arange(60.0), 1.5)[0]
    found, config, runs = again(one, shown, monkeypatch, fails)
    assert runs and found.recording is one.recording and config == Config()


@pytest.mark.slow
def test_a_rig_keeps_its_times(front_end, monkeypatch):
    others = (CameraMaps((), np.zeros(0), front_end.sensors, "right"),)
    one = replace(front_end, t_s=np.arange(89) / 15.0, others=others)
    assert again(one, converted(np.arange(60.0), 1.5)[0], monkeypatch)[2] is False

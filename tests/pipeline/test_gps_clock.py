"""The GPS clock by the video alone: real logs whose time stamps are moved."""

from dataclasses import replace

import numpy as np
import pytest
from brief_videos import first_frames
from fewer_features import fewer_features

import vgps
from scripts.benchmarks.rigs import Darkened
from vgps.config import Config, SensorsConfig
from vgps.errors import GeometryError, GpsLogError
from vgps.evaluation import evaluate
from vgps.gps.clock_rate import ShownClock
from vgps.gps.clock_search import ClockCheck
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.gps.world_frame import world_fixes
from vgps.model import CameraGuess
from vgps.pipeline import camera_refinement, gps_clock
from vgps.pipeline.camera_refinement import with_seen_camera, with_settled_camera
from vgps.pipeline.front_end import run_front_end
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import NoProgress
from vgps.solution import GpsClock

pytestmark = pytest.mark.slow
# than by default: half the time, and the mean error on kitti07 is the same 0.015 m
FEWER_FEATURES = fewer_features(150)
SAID = "older than their time stamps"
HELD = Sensors.fixed(np.zeros(3))


def mean_error(data_dir, solution):
    return evaluate(solution, read_trajectory(data_dir / "kitti07/truth.tum")).camera_position_m.mean


def smoothed(data_dir, log, shift_s, frames):
    """Return so much of kitti07 with time stamps that are later than they should be, and its mean error."""
    recording = first_frames(vgps.open_recording(data_dir / "kitti07", gps=log), frames)
    recording = replace(recording, gps=replace(recording.gps, t_s=recording.gps.t_s + shift_s))
    solution = vgps.smooth(recording, FEWER_FEATURES)
    return solution, mean_error(data_dir, solution)


@pytest.fixture(scope="module")
def front_end(brief):
    """That of a short walk."""
    return run_front_end(vgps.open_recording(brief), Config(), NoProgress())


def test_a_wrong_clock_is_found_where_the_fixes_bend_the_path_to_it(data_dir):
    """Stage C of these finds none, and the poses were 1.7 m off: the car brakes, turns, speeds up."""
    solution, error_m = smoothed(data_dir, "gps_float.nmea", 0.4, 160)
    assert abs(solution.sensors.time_offset_s - 0.4) < 3.0 * solution.sensors.time_offset_sigma_s < 0.1
    assert error_m < 0.25
    speed_m_s = np.linalg.norm(np.diff(solution.world_T_camera[:, :3, 3], axis=0), axis=1) / np.diff(
        solution.t_s
    )
    along_m = solution.sensors.time_offset_sigma_s * np.median(speed_m_s)
    assert np.median(np.linalg.norm(solution.sigma_position_m, axis=1)) > 0.7 * along_m
    assert sum(SAID in warning for warning in solution.warnings) == 1


def test_a_clock_that_is_right_is_left_alone(data_dir, kitti07_fixed):
    sensors = kitti07_fixed.sensors
    assert sensors.time_offset_s == 0.0 and np.isnan(sensors.time_offset_sigma_s)
    assert mean_error(data_dir, kitti07_fixed) < 0.05
    assert not any(SAID in warning for warning in kitti07_fixed.warnings)


def test_a_clock_that_must_not_be_estimated_is_left_alone(recording):
    opened = vgps.open_recording(recording)
    late = replace(opened, gps=replace(opened.gps, t_s=opened.gps.t_s + 0.4))
    held = FEWER_FEATURES.model_copy(update={"sensors": SensorsConfig(estimate_time_offset="no")})
    assert vgps.smooth(late, held).sensors.time_offset_s == 0.0  # "yes" finds the 0.4 s


def test_a_clock_that_is_wrong_by_seconds_is_found_and_the_run_begins_again(data_dir):
    solution, error_m = smoothed(data_dir, "gps_fix.nmea", 3.1, 70)
    assert abs(solution.sensors.time_offset_s - 3.1) < 0.1
    assert error_m < 0.3
    assert sum("the run began again" in warning for warning in solution.warnings) == 1
    assert solution.config["sensors"]["time_offset_s"] == 0.0  # the settings are the user's


def test_where_the_torn_path_shows_nothing_one_without_fixes_does(data_dir, monkeypatch):
    found, search = [], gps_clock.search_time_offset

    def hidden_at_first(*given):
        found.append(search(*given) if found else None)
        return found[-1]

    monkeypatch.setattr(gps_clock, "search_time_offset", hidden_at_first)
    solution, error_m = smoothed(data_dir, "gps_fix.nmea", -5.0, 80)
    assert found[0] is None and found[1:] == [pytest.approx(-5.0, abs=0.3)] * 2  # by its shape, then again
    assert abs(solution.sensors.time_offset_s + 5.0) < 0.1 and error_m < 0.3


def test_an_offset_that_the_new_path_does_not_show_is_dropped(front_end, monkeypatch):
    shown, again = iter([4.0, None]), []
    monkeypatch.setattr(gps_clock, "search_time_offset", lambda *_: next(shown))
    monkeypatch.setattr(gps_clock, "mirrored_share", lambda *_: 0.05)
    monkeypatch.setattr(gps_clock, "run_front_end", lambda *given: again.append(given) or front_end)
    found, config = gps_clock.with_right_clock(front_end, Config(), NoProgress())
    ((_, settings, _),) = again
    assert settings.sensors.time_offset_s == 4.0 and settings.sensors.estimate_time_offset == "yes"
    assert next(shown, "both were asked for") == "both were asked for"
    assert config == Config() and found.maps is front_end.maps
    assert any("4.0 s older" in warning for warning in found.warnings)  # the user may try it
    assert not any("mirrored" in warning for warning in found.warnings)  # with a clock that is far off
    monkeypatch.setattr(gps_clock, "search_time_offset", lambda *_: None)
    for airborne in ("no", "yes"):  # one that flies may be turned anyhow, and is told all the same
        again = gps_clock.with_gps_clock(front_end, Config(start={"airborne": airborne}))
        assert "its picture is mirrored" in again.warnings[0]
        assert again.clock.turned_deg == (180.0 if airborne == "no" else 0.0)


@pytest.mark.parametrize(
    ("torn", "shown_s", "said_s", "found_s", "begins", "stays"),
    [
        (True, 0.3, 0.0, 0.28, True, True),  # a torn path says nothing
        (True, 0.05, 0.0, 0.05, False, False),
        (True, None, 0.3, 0.3, False, False),
        (False, 0.3, 0.25, 0.28, True, True),
        (False, 0.3, 0.25, 0.04, True, False),  # clocks may agree after all
        (False, 0.08, 0.04, 0.05, False, False),
        (False, 0.04, 0.08, 0.05, False, False),
    ],
)
def test_a_path_is_built_again_with_a_clock_within_the_search(
    front_end, monkeypatch, torn, shown_s, said_s, found_s, begins, stays
):
    """Stage D does not mend one that fixes have bent or torn: a walk, 0.26 s early, was 1.3 m off."""
    first = ClockCheck(None, torn=True) if torn else ClockCheck(shown_s)
    doubted = replace(HELD, by_displacements=TimeOffset(said_s, 0.05))
    found = HELD.with_time_offset(TimeOffset(found_s, 0.05))
    runs, compared = [], iter([(first, doubted), (ClockCheck(0.3), found)])

    def with_gps_clock(one, _):
        clock, sensors = next(compared)
        return replace(one, clock=clock, sensors=sensors)

    monkeypatch.setattr(gps_clock, "with_gps_clock", with_gps_clock)
    monkeypatch.setattr(gps_clock, "clock_by_shape", lambda *_: ClockCheck(shown_s))
    monkeypatch.setattr(gps_clock, "run_front_end", lambda _, config, __: runs.append(config) or front_end)
    kept, config = gps_clock.with_right_clock(front_end, Config(), NoProgress())
    assert [run.gps.model for run in runs] == ["none"] * torn + [Config().gps.model] * begins
    assert config == (runs[-1] if stays else Config())
    assert config.sensors.time_offset_s == (shown_s if stays else 0.0)
    assert kept.sensors is (found if stays else doubted)


def test_a_clock_is_doubted_unless_displacements_are_certain():
    doubted = replace(HELD, by_displacements=TimeOffset(0.09, 0.05))
    assert gps_clock._is_doubted(doubted, Config()) and not gps_clock._is_doubted(HELD, Config())
    assert not gps_clock._is_doubted(doubted.with_time_offset(TimeOffset(0.3, 0.02)), Config())
    agreed = replace(doubted.with_time_offset(TimeOffset(0.02, 0.01)), agreed=TimeOffset(0.02, 0.01))
    assert gps_clock._is_doubted(agreed, Config())


@pytest.fixture(scope="module")
def run_once():
    """Stages A to C, run once for all tests of the same settings."""
    made = {}

    def run(recording, config, progress):
        settings = config.model_dump_json()
        if settings not in made:
            made[settings] = run_front_end(recording, config, progress)
        return made[settings]

    return run


@pytest.mark.parametrize(
    ("remaining", "sigmas", "is_kept"),
    [
        (0.001, (0.001, 0.001), True),
        (0.001, (0.02, 0.001), True),  # a path that the wrong clock has torn shows it less well
        (-0.019, (0.001, 0.001), False),
        (0.001, (0.02, 0.02), False),  # as on an orbit at constant speed, which any rate suits
    ],
)
def test_a_rate_that_the_video_shows_begins_the_run_again(
    front_end, run_once, monkeypatch, remaining, sigmas, is_kept
):
    shown, again = zip((0.02, remaining), sigmas, strict=True), []

    def search(*_, **__):
        rate, sigma = next(shown)
        return ShownClock(GpsClock(0.1, rate), 0.01, sigma, True)

    def run_again(*given):
        again.append(given)
        return replace(run_once(*given), clock=None)

    monkeypatch.setattr(gps_clock, "search_clock_rate", search)
    monkeypatch.setattr(gps_clock, "run_front_end", run_again)
    found, config = gps_clock.with_right_clock(front_end, Config(), NoProgress())
    ((noted, settings, _),) = again
    assert settings.sensors.clock_rate == pytest.approx(0.02) and settings.sensors.time_offset_s == 0.1
    assert any("differ by 2.0%" in note and "clock_rate: 0.0200" in note for note in noted.notes)
    assert (config is settings) == is_kept
    if is_kept:
        assert found.sensors.clock_rate == pytest.approx(1.0 - 0.98 * (1.0 - remaining))
        assert found.sensors.clock_rate_sigma == 0.001
    elif sigmas[0] > 0.01:
        assert found.sensors.clock_rate == 0.0 and not any("differ by" in text for text in found.warnings)


def test_fixes_of_a_known_rate_are_where_the_camera_was(data_dir):
    """The stamps of kitti07 with a clock that is 5 % fast."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea")
    recording, clock = first_frames(recording, 60), GpsClock(0.0, 0.05)
    fast = replace(recording, gps=replace(recording.gps, t_s=clock.time_stamps(recording.gps.t_s)))
    config = FEWER_FEATURES.model_copy(update={"sensors": SensorsConfig(clock_rate=0.05)})
    solution = vgps.smooth(fast, config)
    assert solution.sensors.clock_rate == 0.05 and mean_error(data_dir, solution) < 0.05
    np.testing.assert_allclose(solution.fix_times_s, recording.gps.t_s, atol=1e-9)


def test_a_path_that_never_met_the_fixes_shows_their_clock(data_dir):
    """Fixes of the first log contradict it wherever the car turns, and must not bend it."""

    def late(log, late_s):
        recording = vgps.open_recording(data_dir / "kitti07", gps=log)
        return replace(recording, gps=replace(recording.gps, t_s=recording.gps.t_s + late_s))

    recordings = {3.0: late("gps_moving.nmea", 3.0), -6.0: late("gps_ublox.nmea", -6.0)}
    alone = run_front_end(recordings[3.0], FEWER_FEATURES.with_gps("none"), NoProgress())
    for late_s, recording in recordings.items():
        _, fixes = world_fixes(recording, Config())
        assert gps_clock.clock_by_shape(alone, fixes, Config()).shown_s == pytest.approx(late_s, abs=0.25)


def test_frames_at_the_end_that_show_nothing_are_not_compared(brief):
    """In so short a video the rough solution has every frame."""
    opened = first_frames(vgps.open_recording(brief), 30)
    dark = replace(opened, video=Darkened(opened.video, opened.video.times_s[24], np.inf))
    front_end = gps_clock.with_gps_clock(run_front_end(dark, FEWER_FEATURES, NoProgress()), FEWER_FEATURES)
    assert front_end.clock is not None and len(front_end.clock.video) == 24


def test_fixes_are_during_the_video_by_the_configured_time_offset(recording):
    opened = vgps.open_recording(recording)
    late = replace(opened, gps=replace(opened.gps, t_s=opened.gps.t_s + 3600.0))
    with pytest.raises(GpsLogError, match="usable fixes during the video: 0"):
        world_fixes(late, Config())
    _, fixes = world_fixes(late, Config(sensors=SensorsConfig(time_offset_s=3600.0)))
    assert len(fixes) == len(opened.gps.t_s)


def test_a_configured_time_offset_counts_when_the_path_is_placed_in_the_world(brief, monkeypatch):
    """Else a drone that rises first, with positions 5 s older than their stamps, loses its map."""
    opened, asked = vgps.open_recording(brief), []
    late = replace(opened, gps=replace(opened.gps, t_s=opened.gps.t_s + 5.0))
    config = Config(sensors=SensorsConfig(time_offset_s=5.0, estimate_time_offset="no"))
    monkeypatch.setattr(
        "vgps.pipeline.map_aligner.align_to_fixes", lambda _, fixes, *__: asked.append(fixes.t_s)
    )
    run_front_end(late, config, NoProgress())
    assert asked
    for t_s in asked:
        np.testing.assert_allclose(t_s, opened.gps.t_s, atol=1e-9)


@pytest.fixture
def guessed(front_end):
    """The walk's front end, as if its camera, of 260 px, had been guessed with 300."""
    given = front_end.recording.camera
    camera = replace(given, model="opencv", distortion=(0.0,) * 4, fx=300.0, fy=300.0)
    guess = CameraGuess(
        camera=camera, focal_sigma=0.5, centre_sigma_px=6.0, distortion_sigma=(0.2, 0.1), source="a guess"
    )
    return replace(front_end, recording=replace(front_end.recording, camera=camera, guesses=(guess,)))


@pytest.mark.parametrize(
    ("first", "unexplained", "kept"),
    [
        (ClockCheck(1.8), (0.03, 0.001), 600.0),  # seconds off, by a wrong lens
        (ClockCheck(None, torn=True), (0.5, 0.1), 600.0),
        (ClockCheck(1.8), (0.001, 0.03), 300.0),  # the clock was wrong, and the guess was not
        (ClockCheck(0.2), (0.03, 0.001), 300.0),  # nothing to doubt
    ],
)
def test_a_guessed_lens_is_asked_of_the_video_before_a_clock_is_doubted(
    monkeypatch, guessed, first, unexplained, kept
):
    """The camera with which the video explains the fixes better stays."""
    seen, left, runs = replace(guessed.recording.camera, fx=600.0, fy=600.0), {}, []
    left[300.0], left[600.0] = unexplained

    def run(recording, config, _):
        runs.append((recording.camera.fx, config.gps.model))
        return replace(guessed, recording=recording)

    def compared(front_end, _):
        own = front_end.recording.camera.fx == 300.0
        return replace(front_end, clock=first if own else ClockCheck(0.0))

    monkeypatch.setattr(gps_clock, "run_front_end", run)
    monkeypatch.setattr(camera_refinement, "run_front_end", run)
    monkeypatch.setattr(gps_clock, "with_gps_clock", compared)
    monkeypatch.setattr(
        camera_refinement, "with_seen_camera", lambda front_end, _: replace(front_end.recording, camera=seen)
    )
    monkeypatch.setattr(gps_clock, "unexplained", lambda one, _: left[one.recording.camera.fx])
    found = gps_clock._compared_by_the_right_camera(guessed, Config(), NoProgress())
    assert found.recording.camera.fx == kept
    assert ((300.0, "none") in runs) == first.torn
    assert ((600.0, Config().gps.model) in runs) == (first.shown_s != 0.2)


@pytest.mark.parametrize(
    ("shown", "torn", "runs", "last"),
    [
        ((310.0, 260.0, 252.0, 251.0), False, [310.0, 260.0, 252.0], 251.0),  # asked until it says the same
        ((301.0,), False, [], 301.0),
        ((301.0,), True, [300.0], 301.0),  # a torn path is never asked
        ((400.0, 300.0) * 3, False, [400.0, 300.0, 400.0, 300.0], 400.0),  # nor for ever
    ],
)
def test_the_video_is_asked_for_its_lens_until_it_settles(monkeypatch, guessed, shown, torn, runs, last):
    """A path that was made with a wrong lens shows only the way to the right one."""
    ran, left = [], iter(shown)

    def run(recording, config, _):
        assert config.gps.model == "none"
        ran.append(recording.camera.fx)
        return replace(guessed, recording=recording)

    def seen(front_end, _):
        fx = next(left)
        return replace(front_end.recording, camera=replace(front_end.recording.camera, fx=fx, fy=fx))

    monkeypatch.setattr(camera_refinement, "run_front_end", run)
    monkeypatch.setattr(camera_refinement, "with_seen_camera", seen)
    found = with_settled_camera(guessed, Config(), NoProgress(), torn)
    assert (ran, found.camera.fx) == (runs, last)


def test_a_calibrated_camera_is_not_doubted(monkeypatch, front_end):
    monkeypatch.setattr(gps_clock, "with_gps_clock", lambda one, _: replace(one, clock=ClockCheck(1.8)))
    found = gps_clock._compared_by_the_right_camera(front_end, Config(), NoProgress())
    assert found.recording is front_end.recording


def test_the_lens_is_seen_whatever_the_fixes_say(guessed):
    alone = Config().with_gps("none")
    seen = with_seen_camera(guessed, alone)
    elsewhere = replace(guessed.fixes, world_p_fix=guessed.fixes.world_p_fix[::-1].copy())
    assert seen.camera != guessed.recording.camera and seen.guesses == guessed.recording.guesses
    assert with_seen_camera(replace(guessed, fixes=elsewhere), alone).camera == seen.camera


def test_a_lens_is_asked_where_clocks_agree_that_were_configured_seconds_apart(monkeypatch, guessed):
    asked, config = [], Config(sensors=SensorsConfig(time_offset_s=3.0))

    def settled(*_, **__):
        asked.append(1)
        raise GeometryError("no path")

    monkeypatch.setattr(gps_clock, "with_gps_clock", lambda one, _: replace(one, clock=ClockCheck(0.0)))
    monkeypatch.setattr(gps_clock, "with_settled_camera", settled)
    found = gps_clock._compared_by_the_right_camera(guessed, config, NoProgress())
    assert asked and found.recording is guessed.recording

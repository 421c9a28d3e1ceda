"""Videos that play faster or slower than time passes, by the video and its fixes."""

from dataclasses import replace

import numpy as np
import pytest
from fewer_features import fewer_features

import vgps
from vgps.config import Config, SensorsConfig
from vgps.errors import GeometryError
from vgps.evaluation import evaluate
from vgps.gps.video_speed import USUAL_SIGMA, ShownSpeed
from vgps.pipeline import video_speed
from vgps.pipeline.front_end import run_front_end
from vgps.pipeline.video_speed import with_right_speed, with_video_speed
from vgps.readers.trajectory import read_trajectory
from vgps.readers.video.retimed_video import at_speed
from vgps.runtime.progress import NoProgress


def played(recording, speed):
    """Return a recording whose video plays so many seconds in one."""
    return replace(recording, video=at_speed(recording.video, 1.0 / speed))


@pytest.fixture(scope="module")
def lapsed(data_dir):
    """Stages A to C of a drive that plays twice as fast, and its settings."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea")
    config = fewer_features(100)
    return run_front_end(played(recording, 2.0), config, NoProgress()), config


@pytest.mark.slow
def test_a_time_lapse_has_the_path_of_the_drive(data_dir, lapsed):
    front_end, changed = with_right_speed(*lapsed, NoProgress())
    assert changed.sensors.video_speed == 2.0 and changed.sensors.estimate_time_offset == "auto"
    assert front_end.sensors.clock_rate_sigma == USUAL_SIGMA
    truth = read_trajectory(data_dir / "kitti07/truth.tum")
    np.testing.assert_allclose(front_end.t_s, truth.t_s, atol=0.1)
    centres = np.concatenate([one.poses[:, :3, 3] for one in front_end.maps])
    assert np.linalg.norm(centres - truth.world_T_camera[:, :3, 3], axis=1).mean() < 1.0
    assert sum("times as fast as time passes" in note for note in front_end.recording.notes) == 1


@pytest.mark.slow
def test_a_time_lapse_whose_clocks_are_far_apart_has_its_time_offset(lapsed):
    front_end, config = lapsed
    late = replace(front_end.recording.gps, t_s=front_end.recording.gps.t_s + 5.0)
    recording = replace(front_end.recording, gps=late)
    _, changed = with_right_speed(run_front_end(recording, config, NoProgress()), config, NoProgress())
    assert changed.sensors.video_speed == pytest.approx(2.0, rel=0.01)
    assert changed.sensors.time_offset_s == pytest.approx(5.0, abs=0.3)
    assert changed.sensors.estimate_time_offset == "yes"


@pytest.mark.slow
def test_a_speed_that_is_no_whole_number_has_a_sigma_and_what_is_left_of_it_is_estimated(lapsed, monkeypatch):
    monkeypatch.setattr(video_speed, "refined_video_speed", lambda *_: (1.0005, 0.01))
    monkeypatch.setattr(video_speed, "usual_video_speed", lambda *_: None)
    front_end, changed = with_right_speed(*lapsed, NoProgress())
    assert changed.sensors.video_speed == pytest.approx(2.0, rel=0.02)
    assert changed.sensors.estimate_time_offset == "yes" and front_end.sensors.clock_rate_sigma >= 0.01


@pytest.mark.slow
def test_a_speed_at_which_there_is_no_path_counts_for_nothing(lapsed, monkeypatch):
    def none(*given):
        raise GeometryError("no path")

    monkeypatch.setattr(video_speed, "run_front_end", none)
    front_end, changed = with_right_speed(*lapsed, NoProgress())
    assert front_end.recording.video is lapsed[0].recording.video and changed is lapsed[1]


@pytest.mark.slow
def test_a_speed_in_doubt_is_told(lapsed, monkeypatch):
    monkeypatch.setattr(video_speed, "search_video_speed", lambda *_: ShownSpeed(2.0, False, 0.0))
    front_end, changed = with_right_speed(*lapsed, NoProgress())
    assert "if the video plays 2 times as fast as time passes" in front_end.warnings[-1]
    assert front_end.recording is lapsed[0].recording and changed is lapsed[1]


def test_a_speed_that_is_given_is_the_videos(brief):
    recording, config = vgps.open_recording(brief), Config(sensors=SensorsConfig(video_speed=3.0))
    slow = with_video_speed(played(recording, 3.0), config)
    np.testing.assert_allclose(slow.video.times_s, recording.video.times_s)
    assert [frame.t_s for frame in slow.video.frames()] == slow.video.times_s.tolist()
    assert with_video_speed(recording, Config()) is recording


@pytest.mark.slow
def test_a_run_states_the_speed_that_was_given_and_its_frames_have_their_times(brief):
    recording = vgps.open_recording(brief)
    config = Config(sensors=SensorsConfig(video_speed=3.0))
    solution = vgps.smooth(played(recording, 3.0), config)
    np.testing.assert_allclose(solution.t_s, recording.video.times_s)
    truth = read_trajectory(brief / "truth.tum")
    assert evaluate(solution, truth).camera_position_m.mean < 0.3
    assert solution.sensors.video_speed == 3.0

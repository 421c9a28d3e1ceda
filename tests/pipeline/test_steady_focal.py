"""Videos in which the focal length changes: poses, and what the run says of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distinct_solution import distinct_values
from exports import LENSES, consistent
from fewer_features import fewer_features

import vgps
from scripts.common.live_runs import truth_of
from scripts.experiments.changed_videos import breathing, shown_at
from vgps.config import Config
from vgps.model import FocalChanges
from vgps.pipeline import offline
from vgps.pipeline.steady_focal import fits_worse, refuses_more, with_focal_note, with_steady_focal
from vgps.runtime.progress import NoProgress
from vgps.solution import Verdict

CHANGES = FocalChanges((0.0, 2.0), (-0.01, 0.02), (320.0, 240.0))


@pytest.mark.slow
def test_a_focus_that_breathes_is_found_and_does_little_harm(data_dir: Path):
    """It moved poses by 0.2 m among RTK-floats."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_float.nmea")
    t_s, true = recording.video.times_s, truth_of(recording).world_T_camera
    changed = shown_at(recording, (np.arange(len(t_s)), t_s), breathing(recording.camera, 0.01, 7.0))
    found = vgps.smooth(changed, fewer_features(100))
    error = found.world_T_camera[:, :3, 3] - true[:, :3, 3]
    assert np.linalg.norm(error, axis=1).mean() < 0.12
    assert np.mean(np.sum((error / found.sigma_position_m) ** 2, axis=1)) < 4.0
    changes, expected = found.camera.focal_changes, 0.01 * np.sin(2.0 * np.pi * t_s / 7.0)
    assert changes is not None
    assert np.corrcoef(np.log(changes.ratio(t_s)), expected)[0, 1] > 0.7
    assert any("the focal length changes by" in note for note in found.warnings)


def fitted(noise_px, changes):
    """A solution whose observations fit so well, and which shows changes of the focal length or none."""
    solution = consistent(distinct_values(), LENSES["opencv"], noise_px)[0]
    return replace(solution, sensors=replace(solution.sensors, focal_changes=changes))


def test_a_run_without_changes_keeps_its_recording_and_says_nothing(recording: Path):
    opened, solution = vgps.open_recording(recording), distinct_values()
    assert with_steady_focal(opened, solution) is opened
    assert with_focal_note(solution) is solution


def test_a_run_with_changes_is_followed_by_one_of_scaled_pictures(recording: Path):
    opened, solution = vgps.open_recording(recording), distinct_values()
    shown = replace(solution, sensors=replace(solution.sensors, focal_changes=CHANGES))
    assert with_steady_focal(opened, shown).camera.focal_changes == CHANGES


def test_the_warnings_say_what_changes_and_what_is_left():
    solution = distinct_values()
    left = replace(solution, sensors=replace(solution.sensors, focal_changes=CHANGES))
    (note,) = with_focal_note(left).warnings[len(solution.warnings) :]
    assert note.startswith("changes of the focal length by 3 % would explain video and fixes better, but")
    steady = replace(solution, camera=replace(solution.camera, focal_changes=CHANGES))
    (note,) = with_focal_note(steady).warnings[len(solution.warnings) :]
    assert note.startswith("the focal length changes by 3 % in the video") and "still" not in note
    both = replace(left, camera=steady.camera)
    (note,) = with_focal_note(both).warnings[len(solution.warnings) :]
    assert "changes by 3 %" in note and "they still show changes" in note


def test_a_run_that_refuses_more_fixes_has_gone_astray():
    solution = distinct_values()
    assert solution.fixes is not None
    fewer = replace(solution.fixes, verdict=(Verdict.REJECTED,) * len(solution.fixes.verdict))
    assert refuses_more(replace(solution, fixes=fewer), solution)
    assert not refuses_more(solution, replace(solution, fixes=fewer))
    assert not refuses_more(solution, solution)


def test_a_run_fits_worse_by_its_observations():
    before, after = fitted(0.5, None), fitted(0.4, None)
    assert fits_worse(before, after)
    assert not fits_worse(after, before) and not fits_worse(before, before)


def last_of(runs, first, recording, monkeypatch):
    """What is left of a solution and of the runs that follow it."""
    left = list(runs)
    monkeypatch.setattr(offline, "_smoothed", lambda run, _: (left.pop(0), run))
    run = offline._Run(vgps.open_recording(recording), Config())
    return offline._with_one_focal_length(first, run, NoProgress()), len(runs) - len(left)


def test_runs_follow_until_none_shows_a_change_and_the_last_stays(recording, monkeypatch):
    changing, steady = fitted(0.5, CHANGES), fitted(0.4, None)
    found, count = last_of([fitted(0.6, CHANGES), steady], changing, recording, monkeypatch)
    assert found is steady and count == 2
    assert last_of([], steady, recording, monkeypatch) == (steady, 0)


def test_a_zoom_that_the_pictures_do_not_bear_out_is_dropped(recording, monkeypatch):
    """Wrong times of frames contradict the fixes; a zoom seems to explain it, but not the pictures."""
    first, worse = fitted(0.4, CHANGES), fitted(0.5, None)
    assert last_of([worse], first, recording, monkeypatch) == (first, 1)


def test_a_run_astray_on_the_way_is_passed_over(recording, monkeypatch):
    first, better, last = fitted(0.5, CHANGES), fitted(0.4, CHANGES), fitted(0.3, None)
    fewer = replace(better.fixes, verdict=(Verdict.REJECTED,) * len(better.fixes.verdict))
    astray = replace(better, fixes=fewer)
    assert last_of([better, astray, last], first, recording, monkeypatch) == (last, 3)
    ended = replace(astray, sensors=last.sensors)
    assert last_of([better, ended], first, recording, monkeypatch) == (better, 2)

"""Videos in which the focal length changes: poses, and what the run says of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distinct_solution import distinct_values
from exports import LENSES, consistent

import vgps
from scripts.common.live_runs import truth_of
from scripts.experiments.changed_videos import as_it_is, breathing, nearest, shown_at
from vgps.model import FocalChanges
from vgps.pipeline.steady_focal import fits_worse, refuses_more, with_focal_note, with_steady_focal
from vgps.solution import Verdict

CHANGES = FocalChanges((0.0, 2.0), (-0.01, 0.02), (320.0, 240.0))


@pytest.mark.slow
def test_a_focus_that_breathes_is_found_and_does_little_harm(data_dir: Path):
    """It moved poses by 0.2 m among RTK-floats."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_float.nmea")
    t_s, true = recording.video.times_s, truth_of(recording).world_T_camera
    changed = shown_at(recording, (np.arange(len(t_s)), t_s), breathing(recording.camera, 0.01, 7.0))
    found = vgps.smooth(changed)
    error = found.world_T_camera[:, :3, 3] - true[:, :3, 3]
    assert np.linalg.norm(error, axis=1).mean() < 0.08
    assert np.mean(np.sum((error / found.sigma_position_m) ** 2, axis=1)) < 4.0
    changes, expected = found.camera.focal_changes, 0.01 * np.sin(2.0 * np.pi * t_s / 7.0)
    assert changes is not None
    assert np.corrcoef(np.log(changes.ratio(t_s)), expected)[0, 1] > 0.8
    assert any("the focal length changes by" in note for note in found.warnings)


@pytest.mark.slow
def test_a_wrong_calibration_is_no_zoom(data_dir: Path):
    """The file's focal length is too long by a quarter; the video alone shows one that stays."""
    found = vgps.smooth(vgps.open_recording(data_dir / "gopro_walk"))
    assert found.camera.focal_changes is None and found.sensors.focal_changes is None


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
    before, after = (consistent(distinct_values(), LENSES["opencv"], noise_px)[0] for noise_px in (0.5, 0.4))
    assert fits_worse(before, after)
    assert not fits_worse(after, before) and not fits_worse(before, before)


@pytest.mark.slow
def test_wrong_times_of_frames_are_no_zoom(data_dir: Path):
    """The fixes seemed to show one of two per cent, and poses among RTK-floats were off by 0.37 m."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_float.nmea")
    order = nearest(recording.video.times_s, 1.25)
    assert vgps.smooth(shown_at(recording, order, as_it_is)).camera.focal_changes is None

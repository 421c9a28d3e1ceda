"""Videos that show little, or not all of the time: poses stay at their fixes, and their sigmas hold."""

from pathlib import Path

import numpy as np
import pytest

import vgps
from scripts.common.live_runs import truth_of
from scripts.experiments.changed_videos import Stretches, as_it_is, dark, shown_at, without
from vgps.model import FloatArray, Recording

pytestmark = pytest.mark.slow


def smoothed(recording: Recording, true: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return errors and standard deviations (F, 3) of the positions, and the time offset."""
    found = vgps.smooth(recording)
    error = found.world_T_camera[:, :3, 3] - true[:, :3, 3]
    return error, found.sigma_position_m, found.sensors.time_offset_s


def test_a_path_in_the_dark_stays_at_its_fixes(data_dir: Path):
    """Of many maps none had two fixes, and the run was not in the world."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea")
    frame = np.arange(45)
    changed = shown_at(recording, (frame, recording.video.times_s[frame]), dark(10.0, 4.0))
    error, sigma, _ = smoothed(changed, truth_of(recording).world_T_camera[frame])
    assert np.linalg.norm(error, axis=1).mean() < 0.3
    assert np.isfinite(sigma).all() and np.mean(np.sum((error / sigma) ** 2, axis=1)) < 3.0


def test_missing_frames_are_no_other_clock(data_dir: Path):
    """They moved poses by 1.3 m, and the fixes by 0.17 s."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_float.nmea")
    shown, at_s = without(recording.video.times_s, Stretches(1.0, 3.0))
    changed = shown_at(recording, (shown, at_s), as_it_is)
    error, sigma, time_offset_s = smoothed(changed, truth_of(recording).world_T_camera[shown])
    assert abs(time_offset_s) < 0.05 and np.linalg.norm(error, axis=1).mean() < 0.5
    assert np.mean(np.sum((error / sigma) ** 2, axis=1)) < 3.0

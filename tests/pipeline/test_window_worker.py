import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parent / "smoothing"))
from synthetic_bundle import ANTENNA
from synthetic_map import MATRIX, away, map_of, scene

from vgps.config import Config, WindowConfig
from vgps.gps.fix_buffer import FixBuffer
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.pipeline.window_worker import WindowWorker
from vgps.runtime.timing import StageTimer

CONFIG = Config(window=WindowConfig(length_frames=20))


def refiner(fixes):
    return WindowWorker(
        MATRIX, FixBuffer(fixes, ANTENNA, CONFIG), CONFIG, NO_CONTROL_OBSERVATIONS, {}, StageTimer()
    )


def disturbed_map(last):
    problem, true, t_s, fixes = scene(disturbed=2.0)
    start = problem.world_T_camera.copy()
    start[:20] = true[:20]
    return map_of(replace(problem, world_T_camera=start), 0, last), true, t_s, fixes


def test_stage_c_beside_the_frames_finds_what_it_finds_while_they_wait():
    at_once, _, t_s, fixes = disturbed_map(39)
    beside, _, _, _ = disturbed_map(39)
    refiner(fixes).optimise(at_once, t_s[:40])
    worker = refiner(fixes)
    worker.begin(beside, t_s[:40])
    assert worker.busy
    worker.finish()
    assert not worker.busy
    np.testing.assert_array_equal(beside.poses, at_once.poses)
    np.testing.assert_array_equal(beside.points, at_once.points)


def test_frames_that_come_meanwhile_gain_as_well():
    """The map is taken at frame 39; when the result comes there are 50."""
    full, true, t_s, fixes = disturbed_map(49)
    part, _, _, _ = disturbed_map(39)
    full.poses[40:] = full.poses[39] @ np.linalg.inv(true[39]) @ true[40:50]
    worker = refiner(fixes)
    worker.begin(part, t_s[:40])
    (job,) = [worker._job]
    worker._job = replace(job, original=full)
    before = away(full.poses[40:], true[40:50])
    unknown, warnings = worker.finish()
    assert not warnings and len(unknown)
    assert away(full.poses[40:], true[40:50]) < 0.5 * before


def test_what_cannot_be_optimised_is_raised_when_it_is_asked_for():
    broken, _, t_s, fixes = disturbed_map(39)
    broken.poses[30] = np.nan
    kept = broken.poses.copy()
    worker = refiner(fixes)
    worker.begin(broken, t_s[:40])
    with pytest.raises((RuntimeError, ValueError, ArithmeticError)):
        worker.finish()
    assert not worker.busy
    np.testing.assert_array_equal(broken.poses, kept)

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import away, context, map_of, moved, scene

from vgps.config import Config, WindowConfig
from vgps.gps.fix_buffer import FixBuffer
from vgps.pipeline.window_worker import WindowWorker
from vgps.runtime.timing import StageTimer

CONFIG = Config(window=WindowConfig(length_frames=20))


def worker_with(fixes):
    return WindowWorker(context(CONFIG), FixBuffer(fixes, ANTENNA, CONFIG), StageTimer())


def disturbed_map(last):
    problem, true, _, fixes = scene(disturbed=2.0)
    start = problem.world_T_camera.copy()
    start[:20] = true[:20]
    return map_of(replace(problem, world_T_camera=start), 0, last), true, fixes


@pytest.mark.slow
def test_stage_c_in_a_thread_gives_the_same_result_as_at_once():
    at_once, _, fixes = disturbed_map(39)
    beside, _, _ = disturbed_map(39)
    at_once.apply(worker_with(fixes).optimise(at_once).reconciliation.update)
    worker = worker_with(fixes)
    worker.start(beside)
    assert worker.busy
    beside.apply(worker.finish().reconciliation.update)
    assert not worker.busy and worker.finish() is None
    np.testing.assert_array_equal(beside.poses, at_once.poses)
    np.testing.assert_array_equal(beside.points, at_once.points)


@pytest.mark.slow
def test_frames_added_meanwhile_are_corrected_too():
    """The map is taken at frame 39; when the result comes there are 50.

    Their motion is exact, and what is left is the error of the window's newest frames, which grows on.
    """
    full, true, fixes = disturbed_map(49)
    part, _, _ = disturbed_map(39)
    moved(full, 40, lambda _: full.pose(39) @ np.linalg.inv(true[39]) @ true[40:50])
    worker = worker_with(fixes)
    worker.start(part)
    worker._job = replace(worker._job, original=full)
    before = away(full.poses[40:], true[40:50])
    outcome = worker.finish()
    assert outcome.local_map is full and not outcome.warnings and len(outcome.reconciliation.unrefined)
    full.apply(outcome.reconciliation.update)
    assert away(full.poses[40:], true[40:50]) < 0.6 * before


def test_an_error_of_stage_c_is_raised_by_finish():
    broken, _, fixes = disturbed_map(39)
    moved(broken, 30, lambda poses: np.concatenate([np.full((1, 4, 4), np.nan), poses[1:]]))
    kept = broken.poses.copy()
    worker = worker_with(fixes)
    worker.start(broken)
    with pytest.raises((RuntimeError, ValueError, ArithmeticError)):
        worker.finish()
    assert not worker.busy
    np.testing.assert_array_equal(broken.poses, kept)

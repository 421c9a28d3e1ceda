"""Stage C of a snapshot: drift correction, then the window."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import CAMERA, away, context, map_of, moved, scene

from vgps.config import Config, WindowConfig
from vgps.gps.fix_buffer import FixBuffer
from vgps.mapping.map_update import MapUpdate
from vgps.pipeline.stage_c import StageC
from vgps.runtime.timing import CONCURRENT, StageTimer

CONFIG = Config(window=WindowConfig(length_frames=20))


def run(local_map, fixes):
    timer = StageTimer()
    fix_buffer = FixBuffer(fixes, ANTENNA, CONFIG)
    warnings = StageC(context(CONFIG), timer).run(local_map, fix_buffer, CAMERA, CONCURRENT)
    return warnings, timer


def true_map(last=59, aligned=True):
    problem, true, _, fixes = scene(disturbed=0.0)
    return map_of(replace(problem, world_T_camera=true), 0, last, aligned=aligned), true, fixes


@pytest.mark.slow
def test_drift_is_corrected_in_frames_that_the_window_holds():
    local_map, true, fixes = true_map()

    def too_long(poses):
        poses[:, :3, 3] += 0.3 * (poses[:, :3, 3] - true[14, :3, 3])
        return poses

    moved(local_map, 15, too_long)
    before = away(local_map.poses[15:40], true[15:40])
    warnings, timer = run(local_map, fixes)
    assert not warnings and set(timer.by_stage) == {"drift" + CONCURRENT, "window" + CONCURRENT}
    assert away(local_map.poses[15:40], true[15:40]) < 0.3 * before


def test_frames_before_the_window_stay_where_fixes_agree_with_them():
    local_map, _, fixes = true_map()
    before = local_map.poses.copy()
    run(local_map, fixes)
    np.testing.assert_array_equal(local_map.poses[:40], before[:40])
    assert not np.array_equal(local_map.poses[40:], before[40:])


def test_a_map_outside_the_world_is_not_compared_with_fixes():
    local_map, _, fixes = true_map(aligned=False)
    away_from_it = replace(fixes, world_p_fix=fixes.world_p_fix + np.array([50.0, 0.0, 0.0]))
    before = local_map.poses.copy()
    run(local_map, away_from_it)
    np.testing.assert_array_equal(local_map.poses[:40], before[:40])


@pytest.mark.slow
def test_drift_is_corrected_under_isam2_too(monkeypatch):
    """Its past is no truth, but the map keeps the frames that have left as they were."""
    local_map, _, fixes = true_map(49)
    config = Config(window=WindowConfig(length_frames=20, solver="isam2"))
    stage_c = StageC(context(config), StageTimer())
    corrected = []
    monkeypatch.setattr("vgps.pipeline.stage_c.contradicts", lambda *_: True)
    monkeypatch.setattr("vgps.pipeline.stage_c.correct_drift", lambda *_: corrected.append(1) or MapUpdate())
    for _ in range(3):
        assert not stage_c.run(local_map, FixBuffer(fixes, ANTENNA, CONFIG), CAMERA)
    assert len(corrected) == 3 and stage_c.failures == 0

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import MATRIX, away, map_of, scene

from vgps.config import Config, WindowConfig
from vgps.smoothing.window import contradicts, optimise_window

CONFIG = Config(window=WindowConfig(length_frames=20))


def test_the_window_nears_the_truth_and_older_frames_stay_to_the_last_bit():
    problem, true, t_s, fixes = scene(disturbed=2.0)
    start = problem.world_T_camera.copy()
    start[:40] = true[:40]
    made = map_of(replace(problem, world_T_camera=start), 0, 59)
    optimise_window(made, t_s, MATRIX, fixes, ANTENNA, CONFIG)
    np.testing.assert_array_equal(made.poses[:40], true[:40])
    assert away(start[40:], true[40:]) > 0.2
    assert away(made.poses[40:], true[40:]) < 0.3 * away(start[40:], true[40:])


def test_a_map_that_begins_in_the_window_is_held_by_its_fixes():
    problem, true, t_s, fixes = scene(frames=20, disturbed=2.0)
    made = map_of(problem, 0, 19)
    before = away(made.poses, true)
    optimise_window(made, t_s, MATRIX, fixes, ANTENNA, CONFIG)
    assert away(made.poses, true) < 0.6 * before


def test_an_unaligned_map_keeps_its_scale():
    problem, true, t_s, fixes = scene(frames=20)
    made = map_of(problem, 0, 19)
    made.aligned = False
    made.transform(3.0, np.eye(3), np.zeros(3))
    way = np.linalg.norm(made.poses[9, :3, 3] - made.poses[0, :3, 3])
    optimise_window(made, t_s, MATRIX, fixes, ANTENNA, CONFIG)
    kept = np.linalg.norm(made.poses[9, :3, 3] - made.poses[0, :3, 3])
    assert abs(kept / way - 1.0) < 0.02 and away(made.poses, true) > 3.0


def test_fixes_contradict_a_map_only_beyond_region_and_tolerance():
    problem, true, t_s, fixes = scene()
    made = map_of(replace(problem, world_T_camera=true), 0, 59)

    alternately = (-1.0) ** np.arange(len(fixes))

    def asked(moved_m, used=True):
        moved = fixes.world_p_fix + np.outer(alternately * moved_m, [1.0, 0.0, 0.0])
        row = np.full(len(fixes), used)
        return contradicts(made, t_s, replace(fixes, world_p_fix=moved, used=row), ANTENNA, CONFIG)

    assert not asked(0.0) and not asked(0.2)
    assert asked(1.0) and not asked(1.0, used=False)


@pytest.mark.parametrize("axis", [0, 2])
def test_fixes_that_all_lie_to_one_side_contradict_a_map_even_within_the_tolerance(axis):
    problem, true, t_s, fixes = scene()
    made = map_of(replace(problem, world_T_camera=true), 0, 59)

    def asked(moved_m, used):
        moved = fixes.world_p_fix + moved_m * np.eye(3)[axis]
        believed = replace(fixes, world_p_fix=moved, used=np.arange(len(fixes)) >= len(fixes) - used)
        return contradicts(made, t_s, believed, ANTENNA, CONFIG)

    assert not asked(0.08, used=5)
    assert asked(0.2, used=5)
    assert not asked(0.2, used=2)

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_fixes import T_S, drifting, fixes_at, path, poses
from synthetic_map import map_of, scene

from vgps.config import Config
from vgps.smoothing.drift_correction import bend_path, correct_drift, seen_path, unbend


@pytest.fixture
def fixes():
    return fixes_at(np.arange(0.05, 19.0), 0.5, 0.7)


def away(bent):
    return np.linalg.norm(bent[:, :3, 3] - path(T_S), axis=1)


def test_forty_percent_of_scale_drift_is_taken_out(fixes):
    assert away(drifting()).mean() > 5.0
    bent, scale = bend_path(drifting(), T_S, fixes, np.zeros(3), Config())
    assert away(bent).mean() < 0.5
    assert scale[5] == pytest.approx(1.0, abs=0.1) and scale[-5] == pytest.approx(1 / 1.4, abs=0.1)


def test_one_wild_fix_bends_nothing(fixes):
    wild = fixes.world_p_fix.copy()
    wild[9] += [40.0, 0.0, 0.0]
    bent, _ = bend_path(poses(path(T_S)), T_S, replace(fixes, world_p_fix=wild), np.zeros(3), Config())
    assert away(bent).max() < 0.3


def test_fixes_that_no_lag_explains_bend_the_path_as_if_the_clock_were_known(fixes):
    """A metre forward and back again along the way: a free clock would take its share of it."""
    wander = np.sin(fixes.t_s / 3)[:, None] * [0.0, 1.0, 0.0]
    biased = replace(fixes, world_p_fix=fixes.world_p_fix + wander)
    known = Config(sensors={"estimate_time_offset": "no"})
    bent, scale = bend_path(drifting(0.05), T_S, biased, np.zeros(3), Config())
    held, held_scale = bend_path(drifting(0.05), T_S, biased, np.zeros(3), known)
    np.testing.assert_array_equal(bent, held)
    np.testing.assert_array_equal(scale, held_scale)


def test_late_fixes_in_bends_do_not_pull_the_path_into_their_shape(fixes):
    late = replace(fixes, t_s=fixes.t_s + 0.5, r_m=np.full(len(fixes), 0.1), h_m=np.full(len(fixes), 0.1))
    bent, _ = bend_path(poses(path(T_S)), T_S, late, np.zeros(3), Config())
    assert away(bent).mean() < 0.1
    known = Config(sensors={"estimate_time_offset": "no"})
    bent, _ = bend_path(poses(path(T_S)), T_S, late, np.zeros(3), known)
    assert away(bent).mean() > 0.3


def test_a_path_that_hangs_on_a_held_one_keeps_its_start_and_bends_behind_it(fixes):
    """The second half of a drive that lost its scale in the second half alone."""
    half = len(T_S) // 2
    right = poses(path(T_S))
    wrong = right.copy()
    step = np.diff(right[:, :3, 3], axis=0)
    step[half:] *= 1.3
    wrong[1:, :3, 3] = right[0, :3, 3] + np.cumsum(step, axis=0)
    part = fixes.where(fixes.t_s >= T_S[half])
    bent, _ = bend_path(wrong[half:], T_S[half:], part, np.zeros(3), Config(), attached=True)
    off = np.linalg.norm(bent[:, :3, 3] - path(T_S)[half:], axis=1)
    before = np.linalg.norm(wrong[half:, :3, 3] - path(T_S)[half:], axis=1)
    assert off[0] < 0.01 and off.mean() < 0.2 * before.mean()


def test_drift_before_the_horizon_is_left_alone():
    problem, true, t_s, fixes = scene(60, disturbed=0.0)
    local_map = map_of(problem, 0, 59)
    local_map.poses[30:, :3, 3] += 0.1 * (local_map.poses[30:, :3, 3] - local_map.poses[29, :3, 3])
    before = local_map.poses.copy()
    correct_drift(local_map, t_s, fixes, ANTENNA, Config(), since_s=float(t_s[25]))
    np.testing.assert_array_equal(local_map.poses[:25], before[:25])
    off = np.linalg.norm(local_map.poses[:, :3, 3] - true[:, :3, 3], axis=1)
    assert (
        off[25] < 0.05
        and off[25:].mean() < 0.5 * np.linalg.norm(before[25:, :3, 3] - true[25:, :3, 3], axis=1).mean()
    )


def undisturbed_map():
    problem, true, t_s, _ = scene(disturbed=0.0)
    return map_of(replace(problem, world_T_camera=true), 0, 39), true, t_s


def test_a_path_that_late_fixes_bent_still_shows_what_the_frames_saw():
    local_map, true, t_s = undisturbed_map()
    local_map.poses[20:, :3, 3] = true[18:38, :3, 3]  # two frames late
    poses, times = seen_path(local_map, t_s, float(t_s[15]))
    np.testing.assert_array_equal(times, t_s[15:40])
    np.testing.assert_allclose(
        np.diff(poses[:, :3, 3], axis=0), np.diff(true[15:40, :3, 3], axis=0), atol=0.02
    )
    local_map._steps.values[30] = np.nan
    own, _ = seen_path(local_map, t_s, float(t_s[15]))
    step = own[15, :3, 3] - own[14, :3, 3]
    np.testing.assert_allclose(step, local_map.poses[30, :3, 3] - local_map.poses[29, :3, 3])


def test_a_path_torn_by_fixes_that_are_given_up_is_mended():
    local_map, _, t_s = undisturbed_map()
    whole = local_map.snapshot()
    local_map.poses[25:, :3, 3] += [3.0, 0.0, 1.0]
    unbend(local_map, t_s, float(t_s[20]))
    np.testing.assert_allclose(local_map.poses, whole.poses, atol=1e-9)
    seen_after = np.unique(whole.observations(39).landmark)
    moved = local_map.points[seen_after] - whole.points[seen_after]
    np.testing.assert_allclose(moved, np.tile([-3.0, 0.0, -1.0], (len(moved), 1)), atol=1e-9)

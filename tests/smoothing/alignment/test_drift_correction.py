from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_fixes import T_S, drifting, fixes_at, path, trajectory
from synthetic_map import map_of, moved, scene

from vgps.config import Config
from vgps.smoothing.alignment.drift_correction import correct_drift, remove_drift, restore_odometry


@pytest.fixture
def fixes():
    return fixes_at(np.arange(0.05, 19.0), 0.5, 0.7)


def shifted(poses, by):
    poses[:, :3, 3] += by
    return poses


def away(bent):
    return np.linalg.norm(bent[:, :3, 3] - path(T_S), axis=1)


def test_forty_percent_of_scale_drift_is_corrected(fixes):
    assert away(drifting().world_T_camera).mean() > 5.0
    bent, scale = remove_drift(drifting(), fixes, np.zeros(3), Config())
    assert away(bent).mean() < 0.5
    assert scale[5] == pytest.approx(1.0, abs=0.1) and scale[-5] == pytest.approx(1 / 1.4, abs=0.1)


def test_one_outlier_does_not_deform_the_path(fixes):
    wild = fixes.world_p_fix.copy()
    wild[9] += [40.0, 0.0, 0.0]
    bent, _ = remove_drift(trajectory(path(T_S)), replace(fixes, world_p_fix=wild), np.zeros(3), Config())
    assert away(bent).max() < 0.3


def test_fixes_that_no_time_offset_explains_are_fitted_as_with_a_known_one(fixes):
    """A metre forward and back again along the path: a free time offset would absorb part of it."""
    wander = np.sin(fixes.t_s / 3)[:, None] * [0.0, 1.0, 0.0]
    biased = replace(fixes, world_p_fix=fixes.world_p_fix + wander)
    known = Config(sensors={"estimate_time_offset": "no"})
    bent, scale = remove_drift(drifting(0.05), biased, np.zeros(3), Config())
    held, held_scale = remove_drift(drifting(0.05), biased, np.zeros(3), known)
    np.testing.assert_array_equal(bent, held)
    np.testing.assert_array_equal(scale, held_scale)


def test_errors_of_coarse_fixes_do_not_roll_a_straight_path():
    """A path of 20 m swings to the right by a metre, coarse fixes swing upward: as if it lay on its side."""
    swing = np.sin(np.pi * T_S / T_S[-1])
    straight = np.stack([swing, T_S, 0.0 * T_S], axis=1)
    at_s = np.arange(0.5, 19.5)
    swung = np.interp(at_s, T_S, swing)
    sizes = np.where((at_s > 3.0) & (at_s < 16.0), 1.0, 0.02)
    fixes = fixes_at(at_s, sizes, sizes)
    fixes = replace(fixes, world_p_fix=np.stack([0.0 * swung, at_s, swung], axis=1))
    bent, _ = remove_drift(trajectory(straight), fixes, np.zeros(3), Config())
    assert np.degrees(np.arccos(bent[:, 2, 2])).max() < 15.0
    free = Config(start={"level_sigma_deg": 1e3})
    bent, _ = remove_drift(trajectory(straight), fixes, np.zeros(3), free)
    assert np.degrees(np.arccos(bent[:, 2, 2])).min() > 45.0


def test_late_fixes_in_bends_do_not_deform_the_path(fixes):
    late = replace(fixes, t_s=fixes.t_s + 0.5, r_m=np.full(len(fixes), 0.1), h_m=np.full(len(fixes), 0.1))
    bent, _ = remove_drift(trajectory(path(T_S)), late, np.zeros(3), Config())
    assert away(bent).mean() < 0.1
    known = Config(sensors={"estimate_time_offset": "no"})
    bent, _ = remove_drift(trajectory(path(T_S)), late, np.zeros(3), known)
    assert away(bent).mean() > 0.3


def test_an_attached_path_keeps_its_start(fixes):
    """The second half of a drive that lost its scale in the second half alone."""
    half = len(T_S) // 2
    right = path(T_S)
    step = np.diff(right, axis=0)
    step[half:] *= 1.3
    wrong = np.vstack([right[:1], right[0] + np.cumsum(step, axis=0)])
    part = fixes.where(fixes.t_s >= T_S[half])
    bent, _ = remove_drift(trajectory(wrong[half:], T_S[half:]), part, np.zeros(3), Config(), attached=True)
    off = np.linalg.norm(bent[:, :3, 3] - path(T_S)[half:], axis=1)
    before = np.linalg.norm(wrong[half:] - path(T_S)[half:], axis=1)
    assert off[0] < 0.01 and off.mean() < 0.2 * before.mean()


@pytest.mark.slow
def test_frames_before_the_horizon_are_not_changed():
    problem, true, t_s, fixes = scene(60, disturbed=0.0)
    local_map = map_of(problem, 0, 59)
    start = local_map.pose(29)[:3, 3].copy()
    moved(local_map, 30, lambda poses: shifted(poses, 0.1 * (poses[:, :3, 3] - start)))
    before = local_map.poses.copy()
    local_map.apply(correct_drift(local_map, fixes, ANTENNA, Config(), since_s=float(t_s[25])))
    np.testing.assert_array_equal(local_map.poses[:25], before[:25])
    off, was = (np.linalg.norm(each[:, :3, 3] - true[:, :3, 3], axis=1) for each in (local_map.poses, before))
    assert off[25] < 0.05 and off[25:].mean() < 0.5 * was[25:].mean()


def test_fewer_than_two_fixes_change_nothing():
    problem, _, _, fixes = scene(60, disturbed=0.0)
    update = correct_drift(map_of(problem, 0, 59), fixes.where(fixes.t_s < 0.1), ANTENNA, Config())
    assert update.poses is None and update.positions is None


def test_the_odometry_restores_a_path_torn_by_outliers():
    problem, true, t_s, _ = scene(disturbed=0.0)
    local_map = map_of(replace(problem, world_T_camera=true), 0, 39)
    whole = local_map.snapshot()
    moved(local_map, 25, lambda poses: shifted(poses, [3.0, 0.0, 1.0]))
    local_map.apply(restore_odometry(local_map, float(t_s[20])))
    np.testing.assert_allclose(local_map.poses, whole.poses, atol=1e-9)
    seen_after = np.unique(whole.observations(39).landmark)
    by = local_map.points[seen_after] - whole.points[seen_after]
    np.testing.assert_allclose(by, np.tile([-3.0, 0.0, -1.0], (len(by), 1)), atol=1e-9)

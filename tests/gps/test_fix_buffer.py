from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_fixes import fixes_at
from synthetic_map import scene

from vgps.config import Config
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment
from vgps.solution import Trajectory


def rows_of(fixes, rows):
    mask = np.zeros(len(fixes), dtype=bool)
    mask[rows] = True
    return fixes.where(mask)


def test_fixes_are_chronological_in_any_order_of_arrival():
    _, _, _, fixes = scene()
    at_once = FixBuffer(fixes, ANTENNA, Config())
    one_by_one = FixBuffer(Fixes.empty(), ANTENNA, Config())
    order = np.random.default_rng(0).permutation(len(fixes))
    for row in order.tolist():
        one_by_one.add(rows_of(fixes, [row]), now_s=3.0)
    for column in ("t_s", "world_p_fix", "r_m", "h_m", "sigma_m", "used"):
        np.testing.assert_array_equal(getattr(one_by_one.fixes, column), getattr(at_once.fixes, column))
    np.testing.assert_array_equal(order[one_by_one.number], np.arange(len(fixes)))


def test_verdicts_stay_with_their_fixes_when_others_are_inserted():
    _, _, _, fixes = scene()
    fix_buffer = FixBuffer(rows_of(fixes, [0, 2, 4]), ANTENNA, Config())
    fix_buffer.assessment = FixAssessment(np.array([0.9, 0.1, 0.8]), np.array([0.0, 0.0, 0.0]))
    fix_buffer.add(rows_of(fixes, [1, 3]), now_s=9.0)
    assert fix_buffer.number.tolist() == [0, 3, 1, 4, 2]
    assert fix_buffer.assessment.rejected.tolist() == [False, False, True, False, False]
    assert np.isnan(fix_buffer.assessment.nominal[[1, 3]]).all()
    fix_buffer.discard_before(float(fixes.t_s[2]))
    assert fix_buffer.number.tolist() == [1, 4, 2] and fix_buffer.assessment.rejected.tolist() == [
        True,
        False,
        False,
    ]
    assert len(fix_buffer.usable(99.0)) == 3 and not fix_buffer.usable(99.0).used[0]


def test_new_fixes_are_those_of_the_last_interval_and_late_ones_once():
    _, _, _, fixes = scene()
    t_s = float(fixes.t_s[3])
    fix_buffer = FixBuffer(rows_of(fixes, [3]), ANTENNA, Config())
    assert fix_buffer.has_new(t_s - 0.1, t_s) and not fix_buffer.has_new(t_s, t_s + 0.1)
    fix_buffer.add(rows_of(fixes, [1]), now_s=t_s)
    assert fix_buffer.has_new(t_s, t_s + 0.1) and not fix_buffer.has_new(t_s, t_s + 0.1)
    unusable = replace(rows_of(fixes, [2]), used=np.array([False]))
    fix_buffer.add(unusable, now_s=t_s)
    assert not fix_buffer.has_new(t_s, t_s + 0.1)


def test_fixes_are_new_when_the_camera_was_where_they_are():
    _, _, _, fixes = scene()
    t_s, late_s = float(fixes.t_s[3]), 3.0
    sensors = Config().sensors.model_copy(update={"time_offset_s": late_s})
    stamped = replace(fixes, t_s=fixes.t_s + late_s)
    fix_buffer = FixBuffer(rows_of(stamped, [3]), ANTENNA, Config(sensors=sensors))
    assert fix_buffer.has_new(t_s - 0.05, t_s + 0.05)
    assert not fix_buffer.has_new(t_s + late_s - 0.05, t_s + late_s + 0.05)
    fix_buffer.add(rows_of(stamped, [1]), now_s=t_s)  # of a position before now, if not of a stamp
    assert fix_buffer.has_new(t_s, t_s + 0.1)
    np.testing.assert_allclose(fix_buffer.corrected.t_s, fixes.t_s[[1, 3]], atol=1e-9)


def test_after_discarding_few_fixes_do_not_change_the_time_offset():
    _, poses, t_s, fixes = scene()
    late = replace(fixes, t_s=fixes.t_s + 0.7)
    fix_buffer = FixBuffer(late, ANTENNA, Config())
    fix_buffer.update_time_offset(Trajectory(t_s, poses))
    before = fix_buffer.sensors.time_offset_s
    fix_buffer.discard_before(float(late.t_s[5]))
    fix_buffer.update_time_offset(Trajectory(t_s[20:], poses[20:]))
    assert fix_buffer.sensors.time_offset_s == before


def test_after_discarding_fixes_their_time_offset_is_the_prior():
    """Forty fixes on a straight at constant speed do not determine a time offset: the earlier one remains."""
    t_s = 0.1 * np.arange(60)
    east = np.tile(np.eye(4), (60, 1, 1))
    east[:, 0, 3] = 5.0 * t_s
    position = np.stack([5.0 * (t_s[5:50] + 0.05), np.zeros(45), np.zeros(45)], axis=1)
    fixes = replace(fixes_at(t_s[5:50] + 0.05, 0.1, 0.1), world_p_fix=position)
    fix_buffer = FixBuffer(fixes, np.zeros(3), Config())
    fix_buffer.sensors = replace(fix_buffer.sensors, time_offset_s=0.4)
    fix_buffer.discard_before(float(fixes.t_s[3]))
    fix_buffer.update_time_offset(Trajectory(t_s, east))
    assert fix_buffer.sensors.time_offset_s == 0.4


def test_a_snapshot_updates_the_assessment_of_fixes_still_held():
    _, _, _, fixes = scene()
    fix_buffer = FixBuffer(rows_of(fixes, [0, 2, 4]), ANTENNA, Config())
    judged = fix_buffer.snapshot()
    fix_buffer.add(rows_of(fixes, [1, 3]), now_s=9.0)
    fix_buffer.discard_before(float(fixes.t_s[1]))
    judged.assessment = FixAssessment(np.array([0.9, 0.1, 0.8]), np.zeros(3))
    judged.sensors = replace(judged.sensors, time_offset_s=0.25)
    fix_buffer.update_from(judged)
    assert fix_buffer.number.tolist() == [3, 1, 4, 2] and fix_buffer.sensors.time_offset_s == 0.25
    np.testing.assert_array_equal(fix_buffer.assessment.nominal, [np.nan, 0.1, np.nan, 0.8])


def test_a_path_that_begins_after_the_first_fixes_keeps_their_time_offset():
    _, poses, t_s, fixes = scene()
    fix_buffer = FixBuffer(replace(fixes, t_s=fixes.t_s + 0.7), ANTENNA, Config())
    fix_buffer.update_time_offset(Trajectory(t_s[30:], poses[30:]))
    assert fix_buffer.sensors.time_offset_s == 0.0


@pytest.mark.slow
def test_outlier_detection_returns_the_time_of_the_first_used_fix_now_rejected():
    _, poses, t_s, fixes = scene()
    moved = fixes.world_p_fix.copy()
    moved[1:3] += [40.0, 0.0, 0.0]
    wrong = replace(fixes, world_p_fix=moved)
    used = float(fixes.t_s[1]) + 0.01
    fix_buffer = FixBuffer(wrong, ANTENNA, Config())
    assert fix_buffer.detect_outliers(Trajectory(t_s, poses), used) == fixes.t_s[1]
    assert fix_buffer.assessment.rejected[[1, 2]].all()
    assert fix_buffer.detect_outliers(Trajectory(t_s, poses), used) == np.inf
    assert FixBuffer(wrong, ANTENNA, Config()).detect_outliers(Trajectory(t_s, poses)) == np.inf

from dataclasses import replace

import numpy as np
from synthetic_bundle import ANTENNA
from synthetic_map import scene

from vgps.config import Config
from vgps.gps.fix_buffer import FixLedger
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import Judgement


def rows_of(fixes, rows):
    mask = np.zeros(len(fixes), dtype=bool)
    mask[rows] = True
    return fixes.where(mask)


def test_fixes_land_at_their_time_in_any_order_of_coming():
    _, _, _, fixes = scene()
    at_once = FixLedger(fixes, ANTENNA, Config())
    one_by_one = FixLedger(Fixes.none(), ANTENNA, Config())
    order = np.random.default_rng(0).permutation(len(fixes))
    for row in order.tolist():
        one_by_one.add(rows_of(fixes, [row]), now_s=3.0)
    for column in ("t_s", "world_p_fix", "r_m", "h_m", "sigma_m", "used"):
        np.testing.assert_array_equal(getattr(one_by_one.fixes, column), getattr(at_once.fixes, column))
    np.testing.assert_array_equal(order[one_by_one.number], np.arange(len(fixes)))


def test_verdicts_stay_with_their_fixes_when_others_come_between():
    _, _, _, fixes = scene()
    ledger = FixLedger(rows_of(fixes, [0, 2, 4]), ANTENNA, Config())
    ledger.judgement = Judgement(np.array([0.9, 0.1, 0.8]), np.array([0.0, 0.0, 0.0]))
    ledger.add(rows_of(fixes, [1, 3]), now_s=9.0)
    assert ledger.number.tolist() == [0, 3, 1, 4, 2]
    assert ledger.judgement.rejected.tolist() == [False, False, True, False, False]
    assert np.isnan(ledger.judgement.own[[1, 3]]).all()
    ledger.forget(float(fixes.t_s[2]))
    assert ledger.number.tolist() == [1, 4, 2] and ledger.judgement.rejected.tolist() == [True, False, False]
    assert len(ledger.believed(99.0)) == 3 and not ledger.believed(99.0).used[0]


def test_news_are_fixes_within_the_last_interval_or_late_ones_once():
    _, _, _, fixes = scene()
    t_s = float(fixes.t_s[3])
    ledger = FixLedger(rows_of(fixes, [3]), ANTENNA, Config())
    assert ledger.news(t_s - 0.1, t_s) and not ledger.news(t_s, t_s + 0.1)
    ledger.add(rows_of(fixes, [1]), now_s=t_s)
    assert ledger.news(t_s, t_s + 0.1) and not ledger.news(t_s, t_s + 0.1)
    unusable = replace(rows_of(fixes, [2]), used=np.array([False]))
    ledger.add(unusable, now_s=t_s)
    assert not ledger.news(t_s, t_s + 0.1)


def test_after_forgetting_few_fixes_do_not_change_the_clock():
    _, poses, t_s, fixes = scene()
    lagging = replace(fixes, t_s=fixes.t_s + 0.7)
    ledger = FixLedger(lagging, ANTENNA, Config())
    ledger.settle_lag(poses, t_s)
    before = ledger.sensors.lag_s
    ledger.forget(float(lagging.t_s[5]))
    ledger.settle_lag(poses[20:], t_s[20:])
    assert ledger.sensors.lag_s == before


def test_what_a_snapshot_judged_reaches_the_fixes_that_are_still_held():
    _, _, _, fixes = scene()
    ledger = FixLedger(rows_of(fixes, [0, 2, 4]), ANTENNA, Config())
    judged = ledger.snapshot()
    ledger.add(rows_of(fixes, [1, 3]), now_s=9.0)
    ledger.forget(float(fixes.t_s[1]))
    judged.judgement = Judgement(np.array([0.9, 0.1, 0.8]), np.zeros(3))
    judged.sensors = replace(judged.sensors, lag_s=0.25)
    ledger.take(judged)
    assert ledger.number.tolist() == [3, 1, 4, 2] and ledger.sensors.lag_s == 0.25
    np.testing.assert_array_equal(ledger.judgement.own, [np.nan, 0.1, np.nan, 0.8])


def test_a_path_that_begins_after_the_first_fixes_keeps_the_clock_they_showed():
    _, poses, t_s, fixes = scene()
    ledger = FixLedger(replace(fixes, t_s=fixes.t_s + 0.7), ANTENNA, Config())
    ledger.settle_lag(poses[30:], t_s[30:])
    assert ledger.sensors.lag_s == 0.0


def test_judging_tells_when_a_fix_that_was_used_is_given_up():
    _, poses, t_s, fixes = scene()
    moved = fixes.world_p_fix.copy()
    moved[1:3] += [40.0, 0.0, 0.0]
    wrong = replace(fixes, world_p_fix=moved)
    used = float(fixes.t_s[1]) + 0.01
    ledger = FixLedger(wrong, ANTENNA, Config())
    assert ledger.judge(poses, t_s, used) == fixes.t_s[1]
    assert ledger.judgement.rejected[[1, 2]].all()
    assert ledger.judge(poses, t_s, used) == np.inf
    assert FixLedger(wrong, ANTENNA, Config()).judge(poses, t_s) == np.inf

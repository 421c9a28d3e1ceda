from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from synthetic_fixes import T_S, drifting, fixes_at, path, trajectory

from vgps.config import Config
from vgps.gps.fixes import CLASSES
from vgps.gps.outlier_detection import FixAssessment, assess_offsets, detect_outliers
from vgps.model import FixClass

CONFIG = Config()
T_FIX = np.arange(0.05, 19.0)
FIX, FLOAT = (0.07, 0.05), (2.4, 6.5)


def judged(centres, fixes):
    return detect_outliers(centres, fixes, np.zeros(3), CONFIG)


def test_bayes_by_hand():
    """At the fix itself the cylinder's density is 1 / Z, Z integrated numerically."""
    n, omega = CONFIG.gps.n, CONFIG.gps.omega
    area = quad(lambda rho: 2 * np.pi * rho * np.exp(-omega * (rho / 2.4) ** (2 * n)), 0, 30)[0]
    length = 2 * quad(lambda z: np.exp(-omega * (z / 6.5) ** (2 * n)), 0, 80)[0]
    tail = CONFIG.outliers.tail_share
    good = 0.95 * (1.0 - tail + tail / CONFIG.outliers.tail_size**3) / (area * length)
    bad = 0.05 / (2 * np.pi * 50.0**3)
    found = assess_offsets(np.zeros((1, 3)), fixes_at(np.zeros(1), *FLOAT), CONFIG)
    assert found.nominal[0] == pytest.approx(good / (good + bad), rel=1e-9)
    assert found.lower[0] == 0.0


def test_an_rtk_fix_a_metre_off_is_a_float_and_thirty_metres_off_an_outlier():
    offset = np.array([[0.02, 0, 0], [1.0, 0, 0], [30.0, 0, 0], [0, 0, 3.0]])
    found = assess_offsets(offset, fixes_at(1e3 * np.arange(4.0), *FIX, lower=FLOAT), CONFIG)
    assert found.down_classed.tolist() == [False, True, False, True]
    assert found.rejected.tolist() == [False, False, True, False]


@pytest.mark.slow
@given(st.floats(0, 1e3), st.floats(0, 1e3))
@settings(deadline=None)
def test_probabilities_are_probabilities_and_fall_with_distance(near, more):
    offset = np.array([[near, 0, 0], [near + more, 0, 0]])
    found = assess_offsets(offset, fixes_at(1e3 * np.arange(2.0), *FIX, lower=FLOAT), CONFIG)
    assert np.all((found.nominal >= 0) & (found.lower >= 0) & (found.nominal + found.lower <= 1 + 1e-12))
    assert found.nominal[1] <= found.nominal[0] + 1e-12


@pytest.mark.slow
def test_clean_fixes_on_a_drifting_path_are_all_accepted():
    rng = np.random.default_rng(0)
    fixes = fixes_at(T_FIX, 0.5, 0.7, offset=rng.normal(0, 0.15, (19, 3)))
    found = judged(drifting(), fixes)
    assert not found.rejected.any() and found.nominal.min() > 0.5


@pytest.mark.parametrize("seed", range(5))
def test_exactly_the_scattered_outliers_are_rejected(seed):
    rng = np.random.default_rng(seed)
    wrong = rng.choice(19, 6, replace=False)
    offset = rng.normal(0, 0.15, (19, 3))
    offset[wrong] += rng.choice([-1, 1], (6, 3)) * rng.uniform(8, 30, (6, 3))
    found = judged(drifting(0.1), fixes_at(T_FIX, 0.5, 0.7, offset=offset))
    assert sorted(np.flatnonzero(found.rejected)) == sorted(wrong)


def test_a_consistent_cluster_of_false_rtk_fixes_is_rejected():
    offset = np.zeros((19, 3))
    offset[8:12] += [9.0, -7.0, 5.0]
    fix = np.isin(np.arange(19), [0, 1, 2, 8, 9, 10, 11, 17, 18])
    fixes = fixes_at(T_FIX, np.where(fix, 0.07, 2.4), np.where(fix, 0.05, 6.5), offset=offset)
    found = judged(trajectory(path(T_S)), fixes)
    assert np.flatnonzero(found.rejected).tolist() == [8, 9, 10, 11]


@pytest.mark.parametrize("last_s", [2.0, 4.0])
def test_rtk_fixes_at_the_end_are_not_outvoted_by_many_floats(last_s):
    """All floats have one error, within their region, and the path that was built with them lies on them."""
    off_m, fix = np.array([-0.97, -2.15, -2.5]), T_FIX[-1] - last_s < T_FIX
    fixes = fixes_at(
        T_FIX,
        *(np.where(fix, *both) for both in zip(FIX, FLOAT, strict=True)),
        lower=[np.where(fix, size, np.nan) for size in FLOAT],
        offset=np.where(fix[:, None], 0.0, off_m),
    )
    fixes = replace(fixes, fix_class=np.where(fix, 0, CLASSES.index(FixClass.RTK_FLOAT)))
    found = judged(trajectory(path(T_S) + off_m), fixes)
    assert not found.rejected.any() and not found.down_classed.any()


@pytest.mark.parametrize("rate_hz", [1, 5, 10, 20])
def test_a_wrong_stretch_is_rejected_however_often_the_receiver_measures(rate_hz):
    rng = np.random.default_rng(rate_hz)
    t_s = np.arange(0.05, 19.0, 1.0 / rate_hz)
    wrong = (t_s > 8.0) & (t_s < 13.0)
    offset = np.cumsum(rng.normal(0.0, 0.01 / np.sqrt(rate_hz), (len(t_s), 3)), axis=0)
    offset[wrong] += [5.4, -4.2, 3.0]
    found = judged(drifting(0.1), fixes_at(t_s, 0.8, 1.2, offset=offset))
    np.testing.assert_array_equal(found.rejected, wrong)


@pytest.mark.slow
def test_false_fixes_at_the_start_are_rejected():
    """No fixes precede them, and a path that deforms in its first seconds would fit them."""
    offset = np.zeros((19, 3))
    offset[:6] += [9.0, -7.0, 5.0]
    exact = (np.arange(19) < 6) | (np.arange(19) > 15)
    fixes = fixes_at(T_FIX, np.where(exact, 0.07, 2.4), np.where(exact, 0.05, 6.5), offset=offset)
    found = judged(drifting(0.05), fixes)
    assert np.flatnonzero(found.rejected).tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.slow
def test_a_run_to_which_the_path_would_bend_is_left_out_on_trial():
    """The path lost its scale, and without the trial the good fixes about the run are rejected."""
    wrong = (np.arange(19) > 1) & (np.arange(19) < 9)
    found = judged(
        drifting(0.4), fixes_at(T_FIX, 0.5, 0.7, offset=np.where(wrong[:, None], [0.0, -7.0, 0.0], 0.0))
    )
    assert found.rejected[2:].tolist() == wrong[2:].tolist()


@pytest.mark.slow
def test_errors_late_in_a_long_drive_are_found_as_in_a_short_piece():
    """Six minutes and sixteen shared errors: the knots of the drift lie as close as in a short path."""
    t_s, t_fix = 0.2 * np.arange(2000), np.arange(0.05, 399.0, 2.0)
    rng = np.random.default_rng(0)
    offset, wrong = rng.normal(0.0, 0.15, (len(t_fix), 3)), np.zeros(len(t_fix), dtype=bool)
    for first in range(8, len(t_fix) - 6, 12):
        wrong[first : first + 3] = True
        offset[first : first + 3] += rng.choice([-1.0, 1.0], 3) * [2.0, 2.0, 2.5]
    fixes = fixes_at(t_fix, 0.5, 0.7, offset=offset)
    assert judged(trajectory(path(t_s), t_s), fixes).rejected.tolist() == wrong.tolist()


@pytest.mark.slow
def test_later_fixes_reverse_a_verdict():
    """Three fixes jump away from the first five; once ten more agree with them, the five are rejected."""
    offset = np.zeros((19, 3))
    offset[:5] += [15.0, 0.0, 0.0]
    fixes = fixes_at(T_FIX, 0.5, 0.7, offset=offset)
    early = T_S < 8.0
    start = path(T_S) + np.array([15.0, 0.0, 0.0])
    first = detect_outliers(trajectory(start[early], T_S[early]), fixes, np.zeros(3), CONFIG)
    assert np.flatnonzero(first.rejected).tolist() == [5, 6, 7]
    later = first.updated(detect_outliers(trajectory(start), fixes, np.zeros(3), CONFIG))
    assert np.flatnonzero(later.rejected).tolist() == [0, 1, 2, 3, 4]


def test_applied_gives_the_lower_region_and_drops_outliers():
    fixes = fixes_at(np.zeros(3), *FIX, lower=FLOAT)
    believed = FixAssessment(np.array([0.9, 0.1, 0.0]), np.array([0.1, 0.9, 0.0])).applied(fixes)
    assert believed.r_m.tolist() == [0.07, 2.4, 0.07]
    assert believed.used.tolist() == [True, True, False]

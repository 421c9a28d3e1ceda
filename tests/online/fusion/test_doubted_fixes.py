from dataclasses import replace

import numpy as np
import pytest
from fused_drives import INTERVAL_S, DrivingCamera, fit_input, with_class_below
from synthetic_fixes import fixes_of_size

from vgps.config import Config
from vgps.gps.fixes import CLASSES
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FixClass
from vgps.online.fusion.doubted_fixes import Doubt, wrong_probability
from vgps.online.fusion.fusion_fit import fit, fit_with_verdicts

CONFIG = Config()
OUTLIERS = CONFIG.outliers
KNOWN_M2 = 0.04 * np.eye(3)  # the pose before was known to 0.2 m
OUTLIER_M2 = (OUTLIERS.outlier_radius_m / (2.0 * np.pi) ** (1.0 / 6.0)) ** 2


def rtk_fixes(count=2, kind=FixClass.RTK_FIX):
    """RTK-fixes that have errors of 1 m along every axis if they are wrong."""
    fixes = fixes_of_size(np.arange(count, dtype=float), np.zeros((count, 3)), *np.full((2, count), 0.05))
    lower_m = {"lower_r_m": np.full(count, INSIDE_PLANE), "lower_h_m": np.full(count, INSIDE_LINE)}
    return replace(fixes, fix_class=np.full(count, CLASSES.index(kind)), **lower_m)


def probability(moved_m, fixes=None):
    fixes = rtk_fixes() if fixes is None else fixes
    return wrong_probability(fixes, np.asarray(moved_m), KNOWN_M2, OUTLIERS)


def normal(distance_m, variance):
    return np.exp(-0.5 * distance_m**2 / variance) / (2.0 * np.pi * variance) ** 1.5


@pytest.mark.parametrize("moved_m", [0.3, 0.8, 1.0])
def test_the_probability_is_that_of_bayes(moved_m):
    wrong = OUTLIERS.lower_share * normal(moved_m, 1.04)
    wrong += OUTLIERS.outlier_share * normal(moved_m, 0.04 + OUTLIER_M2)
    right = (1.0 - OUTLIERS.lower_share - OUTLIERS.outlier_share) * normal(moved_m, 0.04)
    assert probability([moved_m, 0.0, 0.0]) == pytest.approx(wrong / (wrong + right))


def test_what_the_path_may_have_been_wrong_by_is_no_doubt():
    assert probability([0.4, 0.0, 0.3]) < 0.01
    assert probability([1.1, 0.0, 0.3]) > 0.9


def test_far_off_they_are_outliers():
    assert probability([0.0, 30.0, 0.0]) > 0.999


def test_of_another_class_they_are_outliers_if_they_are_wrong():
    floats = rtk_fixes(kind=FixClass.RTK_FLOAT)
    for moved_m, known_m2 in ((1.0, 0.04 * np.eye(3)), (6.0, np.eye(3))):
        outlier = OUTLIERS.outlier_share * normal(moved_m, known_m2[0, 0] + OUTLIER_M2)
        right = (1.0 - OUTLIERS.outlier_share) * normal(moved_m, known_m2[0, 0])
        found = wrong_probability(floats, np.array([moved_m, 0.0, 0.0]), known_m2, OUTLIERS)
        assert found == pytest.approx(outlier / (outlier + right))


def test_a_path_that_is_hardly_known_makes_them_no_likelier_wrong():
    for moved_m in (0.0, 3.0, 100.0):
        moved = np.array([moved_m, 0.0, 0.0])
        found = wrong_probability(rtk_fixes(), moved, 1e4 * np.eye(3), OUTLIERS)
        assert found < OUTLIERS.lower_share + OUTLIERS.outlier_share


def test_fixes_that_do_not_count_are_not_doubted():
    moved_m, fixes = [3.0, 0.0, 0.0], rtk_fixes()
    assert probability(moved_m, replace(fixes, used=np.zeros(2, dtype=bool))) == 0.0
    assert probability(moved_m, rtk_fixes(0)) == 0.0


def test_the_other_case_is_covered_until_a_receiver_finds_out():
    found = Doubt(20.0, np.array([3.0, 0.0, -1.0]), 0.9)
    np.testing.assert_array_equal(found.covariance(19.9), 0.0)
    at_once = 0.9 * np.array([[9.0, 0.0, -3.0], [0.0, 0.0, 0.0], [-3.0, 0.0, 1.0]])
    np.testing.assert_allclose(found.covariance(20.0), at_once)
    np.testing.assert_allclose(found.covariance(50.0), at_once / np.e)


def test_fixes_that_lead_back_take_the_doubt_back():
    doubted = Doubt(20.0, np.array([3.0, 0.0, -1.0]), 1.0)
    back = Doubt(28.0, np.array([-2.7, 0.3, 0.8]), 1.0)
    assert back.takes_back(doubted)
    for other in (replace(back, moved_m=-back.moved_m), replace(back, moved_m=0.5 * back.moved_m)):
        assert not other.takes_back(doubted)
    assert not replace(back, probability=0.2).takes_back(doubted)


def test_of_two_doubts_that_counts_which_leaves_more_unsure():
    earlier = Doubt(20.0, np.array([2.0, 0.0, 0.0]), 1.0)
    assert not Doubt(21.0, np.array([0.0, 1.5, 0.0]), 1.0).outweighs(earlier)
    assert Doubt(50.0, np.array([0.0, 1.5, 0.0]), 1.0).outweighs(earlier)


@pytest.mark.slow
@pytest.mark.parametrize(("off_m", "delay_s"), [(0.0, 0.0), (2.5, 0.0), (2.5, 0.3)])
def test_rtk_fixes_after_a_while_without_are_doubted_if_the_path_contradicts_them(off_m, delay_s):
    """Also if they come later than the last fit."""
    drive = DrivingCamera(400)
    kinds = np.repeat([FixClass.RTK_FIX, FixClass.DGPS, FixClass.RTK_FIX], [20, 8, 12]).tolist()
    wrong = np.where(np.arange(40)[:, None] >= 28, off_m * np.array([0.8, -0.6, 0.0]), 0.0)
    path, fixes = drive.seen(np.random.default_rng(4), share=0.2), with_class_below(drive.fixes(kinds, wrong))
    last = None
    late = round(delay_s / INTERVAL_S)
    for frames in range(60, 281, 20):
        last = fit(fit_input(path, frames + late, fixes, last, delay_s), CONFIG).fused
    trusting = CONFIG.model_copy(update={"outliers": OUTLIERS.model_copy(update={"enabled": False})})
    now = fit_input(path, 281 + late, fixes, last, delay_s)
    assert fit(now, trusting).doubt is None  # no verdicts, no doubts
    found = fit(now, CONFIG)
    if not off_m:
        assert not found.surprising and found.doubt is None
        return
    doubt = fit_with_verdicts(now, CONFIG).doubt
    assert found.surprising and doubt.probability > 0.9
    np.testing.assert_allclose(doubt.moved_m, [2.0, -1.5, 0.0], atol=0.6)

"""Which of fixes that contradict each other are right, and their verdicts."""

import numpy as np
import pytest
from synthetic_fixes import fixes_at

from vgps.config import Config
from vgps.gps.fix_conflict import FixConflict, sides, with_conflict_verdicts
from vgps.gps.outlier_detection import FixAssessment

CONFIG = Config().outliers
SHARE = CONFIG.lower_share


def of(errors, fixes=None):
    """The sides of runs with these errors, of one fix each or as given, a second apart."""
    level = np.array(errors)
    counts = np.ones(len(level), dtype=int) if fixes is None else np.array(fixes)
    return sides(level[:, None] == level, counts, 1.0, CONFIG)


def test_fixes_without_a_difference_have_no_sides():
    assert of([0, 0, 0]) is None


def test_one_run_is_wrong_rather_than_two_around_it():
    found = of([0, 1, 0], [2, 5, 2])
    np.testing.assert_array_equal(found.right, [True, False, True])
    np.testing.assert_array_equal(found.other, ~found.right)
    odds = np.exp(-1.0 / 30.0) / SHARE / CONFIG.persistence
    assert found.probability == pytest.approx(1.0 / (1.0 + odds))


def test_of_two_sides_the_longer_one_is_right():
    found = of([0, 1], [30, 90])
    np.testing.assert_array_equal(found.right, [False, True])
    assert found.probability == pytest.approx(1.0 / (1.0 + np.exp(2.0)))  # 60 s longer: two of 30 s


def test_a_single_fix_is_wrong_rather_than_several_others():
    found = of([0, 1], [1, 3])
    np.testing.assert_array_equal(found.right, [False, True])
    assert found.probability == pytest.approx(1.0 / (1.0 + np.exp(2.0 / 30.0) / CONFIG.persistence))


def test_wrong_fixes_of_different_errors_are_errors_of_their_own():
    found = of([0, 1, 0, 2, 0, 3, 0], [2, 1, 2, 1, 2, 1, 1])
    np.testing.assert_array_equal(found.right, [True, False, True, False, True, False, True])
    # if one of them were right: six wrong runs instead of three, three of which last
    odds = np.exp(6.0 / 30.0) * SHARE**-3 * CONFIG.persistence**-3
    assert found.probability == pytest.approx(1.0 / (1.0 + odds))


def test_two_equal_sides_are_as_likely():
    assert of([0, 1], [3, 3]).probability == pytest.approx(0.5)


def test_a_much_longer_side_is_certain():
    found = of([0, 1], [1, 30000])
    assert found.probability < 1e-100 and found.right.tolist() == [False, True]


def conflict(error_m, probability=0.1):
    error_m = np.asarray(error_m, dtype=float)
    return FixConflict(
        right=np.array([0, 1, 4]),
        wrong=np.array([2, 3]),
        wrong_s=(2.0, 3.0),
        error_m=error_m,
        otherwise_m=error_m[0],
        probability=probability,
        frames=(0, 50),
    )


FIXES = fixes_at(np.arange(5.0), 0.07, 0.05, lower=(2.4, 6.5))
TAKEN = FixAssessment(np.array([0.1, 1.0, 1.0, 1.0, 1.0]), np.array([0.9, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize("probability", [0.1, 0.5])
def test_wrong_fixes_have_the_class_below_and_right_ones_their_own(probability):
    after = with_conflict_verdicts(TAKEN, [conflict([[0.3, 0.0, 0.1]] * 2, probability)], FIXES)
    np.testing.assert_array_equal(after.down_classed, [False, False, True, True, False])
    assert not after.rejected.any()
    np.testing.assert_allclose(after.nominal[[0, 1, 4]], 1.0 - probability)


def test_what_was_rejected_and_is_wrong_stays_rejected():
    taken = FixAssessment(np.where(np.arange(5) == 3, 0.0, TAKEN.nominal), TAKEN.lower)
    after = with_conflict_verdicts(taken, [conflict([[0.3, 0.0, 0.1]] * 2)], FIXES)
    np.testing.assert_array_equal(after.rejected, [False, False, False, True, False])
    np.testing.assert_array_equal(after.down_classed, [False, False, True, False, False])


@pytest.mark.parametrize("error", [[3.0, 0.0, 0.0], [0.0, 0.0, 9.0], [np.nan] * 3])
def test_what_is_too_far_off_for_that_class_or_unclear_is_rejected(error):
    after = with_conflict_verdicts(TAKEN, [conflict([[0.3, 0.0, 0.1], error])], FIXES)
    np.testing.assert_array_equal(after.down_classed, [False, False, True, False, False])
    np.testing.assert_array_equal(after.rejected, [False, False, False, True, False])


def test_without_conflicts_nothing_changes():
    after = with_conflict_verdicts(TAKEN, [], FIXES)
    np.testing.assert_array_equal(after.nominal, TAKEN.nominal)
    np.testing.assert_array_equal(after.lower, TAKEN.lower)


def test_the_note_says_what_lies_where_and_how_sure_that_is():
    note = conflict([[0.3, 0.4, -0.25], [np.nan] * 3], 0.016).note
    assert "2 from 2.0 to 3.0 s lie 0.50 m in the plane and 0.25 m in height off the others" in note
    assert "with p = 0.016 it is the other way round" in note

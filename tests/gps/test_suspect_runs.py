import numpy as np
import pytest
from synthetic_fixes import T_S, fixes_at, path, trajectory

from vgps.gps.suspect_runs import Stretches, better_without, suspect_runs, trial_masks

ALL = np.ones(19, dtype=bool)
ONE = Stretches(1, np.zeros(19, dtype=int), np.zeros(13, dtype=int))
JUMPS = np.where(np.isin(np.arange(18), [3, 11, 12]), [9.0], [0.5])


def rows(runs):
    return [[run.tolist() for run in of_stretch] for of_stretch in runs]


def test_only_runs_between_jumps_are_suspect():
    assert suspect_runs(np.full(18, 0.5), ALL, ONE, 8) == [[]]
    found = rows(suspect_runs(JUMPS, ALL, ONE, 8))
    assert found == [[[0, 1, 2, 3], [4, 5, 6, 7, 8, 9, 10, 11], [13, 14, 15, 16, 17, 18]]]


def test_the_other_end_of_a_wrong_run_may_be_less_of_a_jump():
    lesser = np.where(np.arange(18) == 5, 0.8, 0.3)
    assert rows(suspect_runs(lesser, ALL, ONE, 8)) == [[]]
    jumps = np.where(np.arange(18) == 11, 9.0, lesser)
    found = rows(suspect_runs(jumps, ALL, ONE, 8))
    assert found == [[[0, 1, 2, 3, 4, 5], [6, 7, 8, 9, 10, 11], [12, 13, 14, 15, 16, 17, 18]]]


def test_fixes_that_are_not_accepted_belong_to_no_run():
    accepted = np.arange(19) != 12
    jumps = np.where(np.arange(17) == 3, 9.0, 0.5)
    assert rows(suspect_runs(jumps, accepted, ONE, 8)) == [[[0, 1, 2, 3]]]


def test_the_largest_jumps_of_each_stretch_count():
    two = Stretches(2, (np.arange(19) > 8).astype(int), np.arange(2))
    jumps = np.full(18, 0.5)
    jumps[[1, 3, 5]] = 2.0, 9.0, 4.0
    jumps[[10, 12, 14]] = 1.1, 1.3, 1.2
    # the run 6 .. 12 is longer than half of its stretch
    assert rows(suspect_runs(jumps, ALL, two, 2)) == [[[0, 1, 2, 3], [4, 5]], [[13, 14], [15, 16, 17, 18]]]


def test_a_trial_leaves_out_one_run_of_each_stretch():
    runs = [[np.array([0, 1]), np.array([4, 5])], [], [np.array([8, 9])]]
    assert [np.flatnonzero(mask).tolist() for mask in trial_masks(runs, 12)] == [[0, 1, 8, 9], [4, 5]]
    assert trial_masks([[], []], 12) == []


def test_each_stretch_keeps_its_own_outcome():
    runs = [[np.array([0, 1]), np.array([4, 5])], [], [np.array([8, 9])], [np.array([11, 12])]]
    energies = np.array([[3.0, 1.0, 5.0, 2.0], [1.0, 0.0, 0.0, 0.0]])
    found = better_without(runs, energies, np.array([2.0, 2.0, 6.0, 2.0]))
    assert [run.tolist() for run in found] == [[4, 5], [8, 9]]


@pytest.mark.parametrize(("knots", "count"), [(2, 1), (62, 1), (63, 2), (602, 10)])
def test_a_stretch_has_at_most_sixty_knots(knots, count):
    fixes = fixes_at(np.array([0.1, 10.0, 19.8]), 0.5, 0.7)
    found = Stretches.along(trajectory(path(T_S)), fixes, knots)
    assert found.count == count
    assert found.of_fix.tolist() == [0, count // 2, count - 1]
    assert np.bincount(found.of_interval).max() <= 61 and found.of_interval[-1] == count - 1
    sums = found.sums(np.ones(3), np.ones(knots - 1))
    assert sums.sum() == pytest.approx(3 + knots - 1)

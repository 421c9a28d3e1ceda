"""Numbers and rows of a report."""

from dataclasses import replace

import numpy as np
import pytest
from solutions import make_fixes

from vgps.report.summary import (
    antenna_positions,
    distance_m,
    doubted_fixes,
    features_per_frame,
    outages,
    unused_reasons,
    verdict_counts,
)
from vgps.solution import Verdict


def without_gps(solution):
    return replace(solution, gps=None, fixes=None)


def without_fixes(solution):
    return replace(solution, gps=solution.gps.rows(np.zeros(0, int)), fixes=make_fixes(np.zeros((0, 3))))


def test_verdicts_are_counted_by_class_best_first(solution):
    counts = verdict_counts(solution)
    assert list(counts) == ["rtk_fix", "rtk_float", "unknown"]
    assert [counts["rtk_fix"][one] for one in Verdict] == [7, 1, 1, 0]
    assert sum(sum(row.values()) for row in counts.values()) == len(solution.gps)


def test_doubted_fixes_are_the_rejected_and_the_down_classed(solution):
    rejected, lowered = doubted_fixes(solution)
    assert (rejected.t_s, rejected.line) == (pytest.approx(3.05 - 0.125), 10)
    # 20 m over r = 0.1 m, 0.5 m over h = 0.05 m
    assert (rejected.ratio_r, rejected.ratio_h) == (pytest.approx(200.0), pytest.approx(10.0))
    assert (lowered.verdict, lowered.fix_class) == (Verdict.DOWN_CLASSED, "rtk_fix")
    # 0.05 m over the 2 m of the class below
    assert lowered.ratio_r == pytest.approx(0.025) and lowered.probability == 0.875


def test_an_outage_has_its_times_its_distance_and_its_largest_sigmas(solution):
    first, last = outages(solution)
    # fixes are 0.125 s older than their stamps: the last one before was true at 19.05 - 0.125 s
    assert (first.begin_s, first.end_s) == (pytest.approx(18.925), pytest.approx(39.925))
    assert first.distance_m == pytest.approx(10.0 * (first.end_s - first.begin_s))
    np.testing.assert_allclose(first.sigma_m, [0.22, 0.42, 0.82], atol=1e-9)
    assert (last.begin_s, last.end_s) == (pytest.approx(54.925), pytest.approx(60.0))  # then none is used


def test_short_gaps_are_not_outages(solution):
    table = solution.fixes
    verdict = [Verdict.USED] * len(table.verdict)
    verdict[30] = Verdict.REJECTED  # two seconds
    found = outages(replace(solution, fixes=replace(table, verdict=tuple(verdict))))
    assert [round(one.end_s - one.begin_s) for one in found] == [21]


def test_reasons_of_unused_fixes_are_counted(solution):
    [(reason, count)] = unused_reasons(solution)
    assert (reason, count) == ("because", 6)


def test_features_distances_and_antenna(solution):
    features = features_per_frame(solution)
    assert features.sum() == len(solution.observations.frame) and features[1] == 0 and features[2] == 3
    assert distance_m(solution)[0] == 0.0 and distance_m(solution)[-1] == pytest.approx(600.0)
    np.testing.assert_allclose(antenna_positions(solution)[10], [10.5, 0.0, 1.0])


@pytest.mark.parametrize("without", [without_gps, without_fixes])
def test_without_a_log_or_fixes_in_it_nothing_is_counted(solution, without):
    alone = without(solution)
    assert verdict_counts(alone) == {} and doubted_fixes(alone) == [] and outages(alone) == []
    assert unused_reasons(alone) == []

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_fixes import T_S, fixes_at, path, trajectory

from vgps.config import Config
from vgps.gps.outlier_detection import FixAssessment
from vgps.gps.verdicts import close_calls, contradictions, fix_table, refusals
from vgps.model import FixClass, GpsLog
from vgps.solution import Verdict

TIMES_S = np.array([-1.0, 1.05, 2.05, 3.05, 4.05, 5.05])
CLASSES = [FixClass.RTK_FIX] * 5 + [FixClass.UNKNOWN]


@pytest.fixture
def table():
    """Fixes: one before the video, one used, three rejected with two of equal error, one without a region."""
    offset = np.zeros((6, 3))
    offset[2] = [5.0, 0.0, 0.0]
    offset[3:5] = [0.0, -9.0, 3.0]
    r_m = np.array([0.07] * 5 + [np.nan])
    fixes = fixes_at(TIMES_S, r_m, 0.05, lower=(2.4, 6.5), offset=offset)
    unknown = np.full(6, np.nan)
    log = GpsLog(
        t_s=TIMES_S,
        latitude_deg=unknown,
        longitude_deg=unknown,
        height_m=unknown,
        fix_class=tuple(CLASSES),
        sigma_m=np.full((6, 3), np.nan),
        hdop=unknown,
        satellites=unknown,
        correction_age_s=unknown,
        line=np.arange(6),
        source=Path("rover.nmea"),
    )
    assessment = FixAssessment(np.array([np.nan, 0.9, 0.0, 0.0, 0.0, np.nan]), np.zeros(6))
    return fix_table(log, fixes, assessment, trajectory(path(T_S)), np.zeros(3), Config())


def test_every_fix_has_a_verdict_and_a_reason(table):
    rejected = [Verdict.REJECTED] * 3
    assert list(table.verdict) == [Verdict.NOT_USED, Verdict.USED, *rejected, Verdict.NOT_USED]
    assert table.reason[0] == "not used: outside the video"
    assert table.reason[1] == "used: the antenna lies in its region"
    assert table.reason[5] == "not used: class unknown has no region"


def test_the_reason_of_a_rejection_has_the_distance_and_whether_the_error_repeats(table):
    assert "71.4 r and 0.0 h away" in table.reason[2] and "p = 1.0000" in table.reason[2]
    alone, lasting = table.reason[3], table.reason[4]
    assert "as the fix before it" not in table.reason[2] + alone
    assert lasting == alone + ", in error as the fix before it"


def test_verdicts_that_hang_by_a_hair_are_named_with_their_alternatives():
    nominal = np.array([1.0, 0.6, 0.05, 0.02, np.nan, 0.9])
    lower = np.array([0.0, 0.0, 0.55, 0.12, np.nan, 0.1])
    (warning,) = close_calls(FixAssessment(nominal, lower), np.arange(6.0))
    assert warning.startswith(
        "uncertain verdicts on fixes: used at 1.0 s (p = 0.60; else rejected), "
        "down-classed at 2.0 s (p = 0.55; else rejected), rejected at 3.0 s (p = 0.86; else down-classed); "
    )
    assert close_calls(FixAssessment(nominal[:1], lower[:1]), np.zeros(1)) == ()


def test_what_a_conflict_tells_is_not_told_again():
    conflict = SimpleNamespace(right=np.array([0]), wrong=np.array([2, 3]))
    (warning,) = close_calls(FixAssessment(np.full(5, 0.5), np.zeros(5)), np.arange(5.0), [conflict])
    assert warning.count("else rejected") == 2 and "at 1.0 s" in warning and "at 4.0 s" in warning


def test_of_many_close_calls_three_are_named():
    (warning,) = close_calls(FixAssessment(np.full(9, 0.5), np.zeros(9)), np.arange(9.0))
    assert "6 more" in warning and warning.count("else rejected") == 3


def test_fixes_refused_in_a_row_are_named_with_times_number_and_metres(table):
    refused, used = [Verdict.REJECTED, Verdict.DOWN_CLASSED] * 2, Verdict.USED
    verdict = (used, *refused, used, *refused[:2], used, *refused[:3])
    residual_m = np.tile([3.0, 4.0, -1.5], (12, 1))
    many = replace(table, residual_m=residual_m, verdict=verdict)
    classes, t_s = [FixClass.RTK_FIX] * 12, np.arange(12.0)
    (warning,) = refusals(many, classes, t_s)
    places = "4 from 1.0 to 4.0 s (5.00 m in the plane, 1.50 m in height), 3 from 9.0 to 11.0 s (5.00 m"
    assert warning.startswith("fixes of class rtk_fix in a row were refused") and places in warning
    told = SimpleNamespace(right=np.array([0]), wrong=np.arange(8, 12))
    (warning,) = refusals(many, classes, t_s, [told])
    assert "9.0" not in warning
    assert refusals(many, classes, 0.1 * t_s) == ()  # soon over
    assert refusals(many, [FixClass.RTK_FLOAT] * 12, t_s) == ()  # single ones are


def test_a_class_whose_fixes_mostly_lie_outside_its_region_is_contradicted(table):
    residual_m = np.zeros((12, 3))
    residual_m[:7, 2] = -0.15  # three times h
    many = replace(
        table,
        residual_m=residual_m,
        r_m=np.full(12, 0.07),
        h_m=np.full(12, 0.05),
        verdict=(Verdict.USED,) * 12,
    )
    (warning,) = contradictions(many, [FixClass.RTK_FIX] * 12)
    assert warning.startswith("the log contradicts its class rtk_fix: 7 of 12 fixes are not within")
    assert "3.0 times as far" in warning
    halved = replace(many, residual_m=np.where(np.arange(12)[:, None] == 0, 0.0, residual_m))
    assert contradictions(halved, [FixClass.RTK_FIX] * 12) == ()
    assert contradictions(many, [FixClass.RTK_FIX, FixClass.RTK_FLOAT] * 6) == ()  # too few of either

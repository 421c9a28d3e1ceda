from datetime import UTC, date, datetime, timedelta, timezone

import pytest

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import (
    Fix,
    axis_sigmas,
    counted,
    damaged_lines,
    skipped,
    unix_day_s,
    unix_s,
    without_held,
)


@pytest.mark.parametrize(
    ("number", "noun", "text"),
    [
        (0, "fix", "0 fixes"),
        (1, "fix", "1 fix"),
        (2, "fix", "2 fixes"),
        (1, "line", "1 line"),
        (3, "line", "3 lines"),
    ],
)
def test_numbers_agree_with_their_nouns(number, noun, text):
    assert counted(number, noun) == text


def test_damaged_lines_are_counted_with_the_first():
    assert damaged_lines([]) == []
    assert damaged_lines([9, 4]) == ["2 damaged or truncated lines skipped, first line 4"]


def test_what_was_skipped_is_noted_where_there_is_any():
    assert skipped(0, "epoch", "without a fix") == []
    assert skipped(2, "epoch", "without a fix") == ["2 epochs without a fix skipped"]
    assert skipped(1, "damaged block") == ["1 damaged block skipped"]


def test_a_horizontal_accuracy_is_that_of_both_axes_together():
    assert axis_sigmas(2.0**0.5, 3.0) == pytest.approx((1.0, 1.0, 3.0))
    nan = float("nan")
    assert axis_sigmas(0.0) == pytest.approx((nan, nan, nan), nan_ok=True)
    assert axis_sigmas(nan, 3.0) == pytest.approx((nan, nan, 3.0), nan_ok=True)
    assert axis_sigmas(2.0**0.5, 0.0) == pytest.approx((1.0, 1.0, nan), nan_ok=True)


def test_seconds_from_1970_whatever_the_time_zone():
    assert unix_s(datetime(1970, 1, 2)) == unix_s(datetime(1970, 1, 2, tzinfo=UTC)) == 86400.0
    assert unix_s(datetime(1970, 1, 2, 9, tzinfo=timezone(timedelta(hours=9)))) == 86400.0
    assert unix_day_s(date(1969, 12, 31)) == -86400.0


def fixes_at(north_m: list[float], step_s: float, decimals: int = 9) -> list[Fix]:
    """Fixes along a meridian, with so many decimals of their degrees."""
    return [
        Fix(n * step_s, round(49.0 + metres / 111_000.0, decimals), 8.4, 150.0, FixClass.SINGLE, n + 1)
        for n, metres in enumerate(north_m)
    ]


@pytest.mark.parametrize(
    ("north_m", "step_s", "decimals", "lines"),
    [
        ([0.0, 0.0, 1.4, 1.4, 2.9, 2.9], 0.1, 9, [1, 3, 5]),  # a walk: 5 positions a second, logged at 10 Hz
        ([0.0, 8.0, 8.0, 8.0, 32.0, 40.0], 1.0, 9, [1, 2, 5, 6]),  # a receiver that hung for two seconds
        ([0.0, 0.0, 0.0, 0.04, 0.2], 0.1, 9, [1, 2, 3, 4, 5]),  # stands, then drives off at 8 m/s^2
        ([0.0, 0.0, 0.0, 1.2, 2.4], 0.1, 5, [1, 2, 3, 4, 5]),  # stands, then moves one step of the digits
        ([0.0, 0.0, 0.0], 1.0, 9, [1, 2, 3]),
        ([0.0, 8.0, 16.0], 1.0, 9, [1, 2, 3]),
        ([], 1.0, 9, []),
    ],
)
def test_a_position_held_until_the_next_is_no_fix_but_that_of_a_stand_is(north_m, step_s, decimals, lines):
    kept, notes = without_held(fixes_at(north_m, step_s, decimals))
    assert [fix.line for fix in kept] == lines
    dropped = len(north_m) - len(lines)
    assert notes == skipped(dropped, "fix", "that repeated a position out of date")

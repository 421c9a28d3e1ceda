from datetime import UTC, date, datetime, timedelta, timezone

import pytest

from vgps.readers.gps_formats.fixes import counted, damaged_lines, unix_day_s, unix_s


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


def test_seconds_from_1970_whatever_the_time_zone():
    assert unix_s(datetime(1970, 1, 2)) == unix_s(datetime(1970, 1, 2, tzinfo=UTC)) == 86400.0
    assert unix_s(datetime(1970, 1, 2, 9, tzinfo=timezone(timedelta(hours=9)))) == 86400.0
    assert unix_day_s(date(1969, 12, 31)) == -86400.0

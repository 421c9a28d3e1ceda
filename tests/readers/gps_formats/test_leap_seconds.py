from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from vgps.readers.gps_formats.fixes import unix_s
from vgps.readers.gps_formats.leap_seconds import utc_from_gps


@pytest.mark.parametrize(
    ("gps", "utc"),
    [
        (datetime(1980, 1, 6), datetime(1980, 1, 6)),
        (datetime(2008, 12, 31, 23, 59, 59), datetime(2008, 12, 31, 23, 59, 45)),
        (datetime(2012, 7, 1, 0, 0, 14), datetime(2012, 6, 30, 23, 59, 59)),
        (datetime(2012, 7, 1, 0, 0, 16), datetime(2012, 7, 1)),
        (datetime(2017, 1, 1, 0, 0, 16), datetime(2016, 12, 31, 23, 59, 59)),
        (datetime(2017, 1, 1, 0, 0, 18), datetime(2017, 1, 1)),
        (datetime(2025, 8, 28, 17, 30, 39), datetime(2025, 8, 28, 17, 30, 21)),
    ],
)
def test_leap_seconds_of_the_date(gps, utc):
    assert utc_from_gps(np.array([unix_s(gps)]))[0] == unix_s(utc)


def test_the_table_is_that_of_the_system():
    """Against the IERS list that ships with the time zone database, where it is installed."""
    source = Path("/usr/share/zoneinfo/leap-seconds.list")
    if not source.is_file():
        pytest.skip(f"no {source}")
    rows = [line.split()[:2] for line in source.read_text().splitlines() if not line.startswith("#")]
    from_1900 = unix_s(datetime(1900, 1, 1))
    for since_1900, tai_minus_utc in rows:
        utc, offset = from_1900 + int(since_1900), int(tai_minus_utc) - 19
        if offset >= 0:
            assert utc_from_gps(np.array([utc + offset]))[0] == utc

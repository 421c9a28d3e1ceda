"""IGC files of gliders' and paragliders' loggers: B records with GNSS altitude, as the FAI specifies."""

import re
from datetime import date
from pathlib import Path

import numpy as np

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import (
    DAY_S,
    Clock,
    Fix,
    RawLog,
    damaged_lines,
    from_sea_level,
    skipped,
    unix_day_s,
)

_DATE = re.compile(rb"^HFDTE(?:DATE:)?\s*(\d\d)(\d\d)(\d\d)", re.MULTILINE)
_DATUM = re.compile(rb"^HFALG[^\r\n:]*:\s*(ELL|GEO)", re.MULTILINE)
_RECORD = re.compile(
    rb"B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])([AV])(-\d{4}|\d{5})(-\d{4}|\d{5})"
)
_HEAD = re.compile(rb"A[A-Za-z0-9]{3,}[^\n]*\r?\n(?:[^\n]*\n){0,60}?H[FOP]DTE")


def looks_like_igc(data: bytes) -> bool:
    """Whether a manufacturer's record is followed by a date."""
    return _HEAD.match(data.removeprefix(b"\xef\xbb\xbf")[:4000]) is not None


def read_igc(data: bytes, path: Path) -> RawLog:
    """Read the B records in UTC; 3-D fixes are single, 2-D ones (validity V) are left out.

    Altitudes are ellipsoidal, or above the geoid if the header ``HFALG`` says so.

    Raises:
        GpsLogError: The file has no date.
    """
    found = _DATE.search(data)
    try:
        day_s = unix_day_s(date(2000 + int(found[3]), int(found[2]), int(found[1]))) if found else np.nan
    except ValueError:
        day_s = np.nan
    if not np.isfinite(day_s):
        raise GpsLogError("no date", file=path, expected="a record HFDTEddmmyy")
    fixes, damaged, flat, before_s = [], [], 0, -np.inf
    for number, line in enumerate(data.splitlines(), 1):
        if not line.startswith(b"B"):
            continue
        record = _RECORD.match(line)
        if record is None:
            damaged.append(number)
            continue
        if record[10] == b"V":
            flat += 1
            continue
        clock_s = 3600.0 * int(record[1]) + 60.0 * int(record[2]) + int(record[3])
        if clock_s < before_s - DAY_S / 2:  # past midnight
            day_s += DAY_S
        before_s = clock_s
        fixes.append(_fix(record, day_s + clock_s, number))
    notes = damaged_lines(damaged) + skipped(flat, "record", "without a three-dimensional fix")
    datum = _DATUM.search(data)
    if datum is not None and datum[1] == b"GEO":
        fixes, about_heights = from_sea_level(fixes)
        notes += about_heights
    return RawLog(Clock.UTC, fixes, notes)


def _fix(record: re.Match[bytes], t_s: float, line: int) -> Fix:
    latitude = int(record[4]) + int(record[5]) / 60_000.0
    longitude = int(record[7]) + int(record[8]) / 60_000.0
    return Fix(
        t_s,
        -latitude if record[6] == b"S" else latitude,
        -longitude if record[9] == b"W" else longitude,
        float(record[12]),
        FixClass.SINGLE,
        line,
    )

"""Logs of Android's GNSS apps (Google's GnssLogger, GPSTest): lines ``Fix,GPS,...`` among raw measurements.

A comment names the columns: ``# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,
AccuracyMeters,BearingDegrees,UnixTimeMillis,...,VerticalAccuracyMeters``; older apps have ``(UTC)TimeInMs``
after the accuracy. Altitudes of Android are above the ellipsoid.
"""

import math
import re

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import (
    Clock,
    Fix,
    RawLog,
    axis_sigmas,
    damaged_lines,
    skipped,
    with_a_height,
)

_HEADER = re.compile(r"^# *(Fix,Provider,.*)$", re.MULTILINE)
_PROVIDERS = (("gps",), ("flp", "fused"))  # the receiver, else the phone's mixture; never the network alone
_TIMES = ("UnixTimeMillis", "(UTC)TimeInMs")
_LATITUDE, _LONGITUDE, _ALTITUDE, _ACCURACY = 2, 3, 4, 6
_VERTICAL = "VerticalAccuracyMeters"


def looks_like_android(data: bytes) -> bool:
    """Whether a comment names the columns of the lines ``Fix``, and there is one."""
    return re.search(rb"^# *Fix,Provider,", data, re.MULTILINE) is not None and b"\nFix," in data


def read_android(data: bytes) -> RawLog:
    """Read the lines ``Fix``; every fix is single, with the phone's accuracies as sigmas.

    Those of the receiver are read, without any the fused ones. Damaged lines are skipped and counted.
    """
    text = data.decode("utf-8", errors="replace")
    header = _HEADER.search(text)
    columns = [name.strip() for name in header[1].split(",")] if header else []
    time_at = next((columns.index(name) for name in _TIMES if name in columns), len(columns))
    vertical_at = columns.index(_VERTICAL) if _VERTICAL in columns else len(columns)
    fixes: dict[str, list[Fix]] = {}
    damaged = []
    for number, line in enumerate(text.split("\n"), 1):
        if not line.startswith("Fix,"):
            continue
        row = line.rstrip("\r").split(",")
        try:
            fix = _fix(row, number, time_at, vertical_at)
        except (ValueError, IndexError):
            damaged.append(number)
        else:
            fixes.setdefault(row[1].lower(), []).append(fix)
    found = [[fix for name in names for fix in fixes.get(name, [])] for names in _PROVIDERS]
    chosen = next((rows for rows in found if rows), [])
    others = sum(map(len, fixes.values())) - len(chosen)
    placed, about_heights = with_a_height(chosen)
    notes = [*damaged_lines(damaged), *skipped(others, "fix", "of other providers")]
    return RawLog(Clock.UTC, placed, notes, doubts=about_heights)


def _fix(row: list[str], number: int, time_at: int, vertical_at: int) -> Fix:
    vertical = row[vertical_at] if vertical_at < len(row) else ""
    return Fix(
        t_s=float(row[time_at]) * 1e-3,
        latitude_deg=float(row[_LATITUDE]),
        longitude_deg=float(row[_LONGITUDE]),
        height_m=float(row[_ALTITUDE] or math.nan),
        fix_class=FixClass.SINGLE,
        line=number,
        sigma_m=axis_sigmas(float(row[_ACCURACY] or math.nan), float(vertical or math.nan)),
    )

"""RTKLIB solution files (``.pos``) in all their variants.

Format: RTKLIB manual 2.4.2, appendix B.1, and ``outsol``/``outsolhead`` of its ``solution.c``.
"""

import re
from collections import Counter
from dataclasses import dataclass
from datetime import date, time
from pathlib import Path
from typing import Literal

import numpy as np

from vgps.errors import GpsLogError
from vgps.geodesy import ecef_to_geodetic, enu_R_ecef, to_geodetic
from vgps.model import FixClass, FloatArray, GeodeticPoint
from vgps.readers.gps_formats.fixes import (
    HIGHEST_M,
    Clock,
    Fix,
    RawLog,
    damaged_lines,
    from_sea_level,
    sigmas_and_correlations,
    skipped,
    unix_day_s,
)
from vgps.readers.gps_formats.leap_seconds import GPS_EPOCH_S, WEEK_S, utc_from_gps

QUALITY = {
    1: FixClass.RTK_FIX,
    2: FixClass.RTK_FLOAT,
    3: FixClass.SBAS,
    4: FixClass.DGPS,
    5: FixClass.SINGLE,
    6: FixClass.PPP,
}
_HEADER = re.compile(r"%\s*(GPST|UTC|JST)\b(.*)")
_ROW = re.compile(rb"\s*(\d{4}/\d\d?/\d\d?|\d{1,4})[\s,;]+(\d\d?:\d\d:\d\d|\d{1,6}(\.\d*)?\b)")
_REF_POS = re.compile(r"%\s*ref pos\s*:(.*)")
_SEPARATOR = re.compile(r"[\s,;]+")
_TIME_COLUMNS = 2
_LAST_WEEK = 9999  # GPS weeks have at most four digits
_LARGEST = 1e12  # no column of a solution has larger numbers
_JST_S = 9 * 3600.0
_INSIDE_M = 6e6  # from the Earth's centre: the ground is farther, and no height is as large

Frame = Literal["geodetic", "ecef", "enu"]


@dataclass(frozen=True, kw_only=True)
class _Header:
    """The comment lines: time system, position columns, and the base station of a baseline."""

    time_system: str = "GPST"
    frame: Frame = "geodetic"
    sexagesimal: bool = False
    origin: GeodeticPoint | None = None
    above_sea: bool = False
    notes: tuple[str, ...] = ()

    @property
    def position_columns(self) -> int:
        return 7 if self.sexagesimal else 3


_UNNAMED = _Header(notes=("no line of column names: assumed GPST, latitude and longitude in degrees",))
_UNNAMED_ECEF = _Header(frame="ecef", notes=("no line of column names: assumed GPST and ECEF coordinates",))


def looks_like_pos(data: bytes) -> bool:
    """Whether a comment line names RTKLIB's time column, or the first row starts with RTKLIB's time."""
    head = data[:20000].decode("ascii", errors="replace")
    if any(_HEADER.match(line) for line in head.splitlines()):
        return True
    first = next((line for line in data.splitlines() if line.strip() and not line.startswith(b"%")), b"")
    return bool(_ROW.match(first)) and len(_SEPARATOR.split(first.decode("ascii", "replace").strip())) >= 7


def read_pos(data: bytes, path: Path) -> RawLog:
    """Read an RTKLIB solution onto UTC.

    Times are calendar times or GPS weeks and times of week, in GPST, UTC or JST. Positions are latitude,
    longitude (degrees, or degrees, minutes and seconds) and height, ECEF coordinates, or a baseline east,
    north, up from the header's ``ref pos``. Without a header (``out-outhead=off``) they are degrees or ECEF,
    which their size tells. Columns are separated by blanks, commas, semicolons or tabs. Rows with fewer
    columns than the others (a truncated end) or absurd numbers are skipped and counted.

    Raises:
        GpsLogError: A baseline has no ``ref pos``.
    """
    lines = data.decode("ascii", errors="replace").splitlines()
    header = _header([line for line in lines if line.startswith("%")], path)
    t_s, values, line, damaged = _rows(lines, header)
    if header == _UNNAMED and len(values) and np.median(np.linalg.norm(values[:, :3], axis=1)) > _INSIDE_M:
        header = _UNNAMED_ECEF
    if header.time_system == "GPST":
        t_s = utc_from_gps(t_s)
    elif header.time_system == "JST":
        t_s = t_s - _JST_S
    geodetic, rest = _positions(values, header), values[:, header.position_columns :]
    uncertainty = np.hstack(_sigmas(rest, geodetic, header))
    numbers = np.column_stack([t_s, geodetic, uncertainty, _column(rest, 1), _column(rest, 8)]).tolist()
    quality = np.clip(np.nan_to_num(rest[:, 0]), -1, 99).round().astype(int).tolist()
    fixes = [
        _fix(row, QUALITY.get(q, FixClass.UNKNOWN), number)
        for row, q, number in zip(numbers, quality, line, strict=True)
        if q > 0
    ]
    notes = [*header.notes, *damaged_lines(damaged)]
    if header.above_sea:
        fixes, about_heights = from_sea_level(fixes)
        notes += about_heights
    notes += skipped(len(quality) - len(fixes), "epoch", "without a fix")
    return RawLog(Clock.UTC, fixes, notes)


def _fix(row: list[float], kind: FixClass, line: int) -> Fix:
    t_s, latitude, longitude, height, east, north, up, en, eu, nu, satellites, age = row
    return Fix(
        t_s,
        latitude,
        longitude,
        height,
        kind,
        line,
        (east, north, up),
        satellites=satellites,
        correction_age_s=age,
        correlation=(en, eu, nu),
    )


def _column(rest: FloatArray, index: int) -> FloatArray:
    """Return a column after the position; NaN where the file has none."""
    return rest[:, index] if rest.shape[1] > index else np.full(len(rest), np.nan)


def _header(comments: list[str], path: Path) -> _Header:
    named = next((match for line in comments if (match := _HEADER.match(line))), None)
    if named is None:
        return _UNNAMED
    columns = named[2]
    if "x-ecef" in columns:
        return _Header(time_system=named[1], frame="ecef")
    if "e-baseline" in columns:
        return _Header(time_system=named[1], frame="enu", origin=_origin(comments, path))
    above_sea = any("WGS84/geodetic" in line for line in comments)
    return _Header(time_system=named[1], sexagesimal="(d'" in columns, above_sea=above_sea)


def _origin(comments: list[str], path: Path) -> GeodeticPoint:
    text = next((match[1] for line in comments if (match := _REF_POS.match(line))), "")
    try:
        numbers = [float(part) for part in _SEPARATOR.split(text.strip())]
        place = degrees_of(np.array([numbers])) if len(numbers) == 7 else np.array([numbers])
        latitude, longitude, height = place[0].tolist()
        if not (abs(latitude) <= 90 and abs(longitude) <= 360 and abs(height) <= HIGHEST_M):
            raise ValueError("no place on the Earth")
    except ValueError:
        raise GpsLogError(
            "the base station of the baselines is unknown",
            file=path,
            expected="a comment line '% ref pos : latitude longitude height'",
            remedy="write the solution as latitude, longitude and height instead",
        ) from None
    return GeodeticPoint(latitude, longitude, height)


def _rows(lines: list[str], header: _Header) -> tuple[FloatArray, FloatArray, list[int], list[int]]:
    """Return times as written, the columns after them, the rows' lines, and the damaged lines."""
    parsed = [
        (number, _row(line))
        for number, line in enumerate(lines, 1)
        if line.strip() and not line.startswith("%")
    ]
    widths = Counter(len(row) for _, row in parsed if row is not None)
    width = max(widths, key=lambda size: (widths[size], size), default=0)
    width = max(width, header.position_columns + _TIME_COLUMNS)
    good = [(number, row) for number, row in parsed if row is not None and len(row) >= width]
    damaged = [number for number, row in parsed if row is None or len(row) < width]
    table = np.array([row[:width] for _, row in good], float).reshape(-1, width)
    return table[:, 0], table[:, 1:], [number for number, _ in good], damaged


def _row(line: str) -> list[float] | None:
    """Return the time [s from 1970 in the file's time system] and all numbers after it; None if damaged."""
    tokens = _SEPARATOR.split(line.strip())
    try:
        row = [_time(tokens[0], tokens[1]), *map(float, tokens[_TIME_COLUMNS:])]
    except (ValueError, OverflowError, IndexError):
        return None
    return None if any(abs(number) > _LARGEST for number in row) else row


def _time(first: str, second: str) -> float:
    """Return seconds from 1970; raises ValueError or OverflowError where no calendar has the time."""
    if "/" not in first:
        week, of_week_s = int(first), float(second)
        if not (0 <= week <= _LAST_WEEK and 0 <= of_week_s <= WEEK_S):
            raise ValueError("no GPS week or time of week")
        return GPS_EPOCH_S + week * WEEK_S + of_week_s
    year, month, day = map(int, first.split("/"))
    hour, minute, seconds = second.split(":")
    midnight_s, begun = unix_day_s(date(year, month, day)), time(int(hour), int(minute))
    if not 0 <= float(seconds) <= 61:
        raise ValueError("no second of a minute")
    return midnight_s + begun.hour * 3600 + begun.minute * 60 + float(seconds)


def _positions(values: FloatArray, header: _Header) -> FloatArray:
    place = values[:, : header.position_columns]
    if header.sexagesimal:
        return degrees_of(place)
    if header.frame == "ecef":
        return ecef_to_geodetic(place)
    if header.frame == "enu" and header.origin is not None:
        return to_geodetic(header.origin, place)
    return place


def degrees_of(place: FloatArray) -> FloatArray:
    """Return (N, 3) decimal degrees and heights of degrees, minutes, seconds (N, 7).

    The sign, of -0 too, is that of the degrees.
    """
    angle = np.abs(place[:, [0, 3]]) + place[:, [1, 4]] / 60 + place[:, [2, 5]] / 3600
    return np.column_stack([np.copysign(angle, place[:, [0, 3]]), place[:, 6]])


def _sigmas(rest: FloatArray, geodetic: FloatArray, header: _Header) -> tuple[FloatArray, FloatArray]:
    """Return standard deviations east, north, up, NaN where the file has none, and their correlations."""
    if rest.shape[1] < (8 if header.frame == "ecef" else 5):
        return np.full((len(rest), 3), np.nan), np.zeros((len(rest), 3))
    # standard deviations, then signed square roots of the covariances: of axes 0 and 1, 1 and 2, 2 and 0
    squared = rest[:, 2:8] * np.abs(rest[:, 2:8])
    if squared.shape[1] < 6:
        squared = np.hstack([squared[:, :3], np.zeros((len(rest), 3))])
    covariance = squared[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(-1, 3, 3)
    if header.frame == "geodetic":
        covariance = covariance[:, [1, 0, 2]][:, :, [1, 0, 2]]  # north, east, up
    elif header.frame == "ecef":
        R = enu_R_ecef(geodetic[:, 0], geodetic[:, 1])
        covariance = R @ covariance @ np.swapaxes(R, 1, 2)
    return sigmas_and_correlations(covariance)

"""Subtitles that DJI drones write beside their videos: positions and heights at the video's times.

Newer drones write ``[latitude: 48.1] [longitude: 11.5] [rel_alt: 10.1 abs_alt: 530.2]`` (some spell
``longtitude``, some give one ``altitude``), older ones ``GPS(11.5,48.1,530) BAROMETER:10.1`` with the
longitude first.
"""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import srt

from vgps.errors import GpsLogError
from vgps.model import FixClass, FloatArray
from vgps.readers.fixes import Clock, Fix, RawLog, counted

_NUMBER = r"\s*[:=]?\s*([-+]?\d+(?:\.\d+)?)"
_LATITUDE, _LONGITUDE = re.compile(rf"latitude{_NUMBER}"), re.compile(rf"longt?itude{_NUMBER}")
_GPS = re.compile(r"GPS\s*:?\s*\(([^()]*)\)")
_ABSOLUTE = re.compile(rf"(?:abs_alt|\baltitude){_NUMBER}")
_RELATIVE = re.compile(rf"(?:rel_alt|BAROMETER){_NUMBER}|\bH\s+([-+]?\d+(?:\.\d+)?)\s*m\b")
_TIMES = re.compile(rb"\d\d:\d\d:\d\d[,.]\d{1,3}\s*-->\s*\d\d:\d\d:\d\d")
logging.getLogger("srt").setLevel(logging.ERROR)  # it logs the whole text that it skips
_STILL_S = 1.0  # a position repeated for longer than this is a new fix


@dataclass(frozen=True, kw_only=True)
class _Row:
    """A subtitle's position; NaN for unknown heights. ``old`` marks the form ``GPS(...)``."""

    number: int
    t_s: float
    latitude_deg: float
    longitude_deg: float
    absolute_m: float
    relative_m: float
    old: bool


def looks_like_srt(data: bytes) -> bool:
    """Whether the file begins with the times of a subtitle."""
    return _TIMES.search(data[:400]) is not None


def read_dji_srt(data: bytes, path: Path) -> RawLog:
    """Read a drone's subtitles onto the video's clock; ``line`` counts the subtitles.

    Subtitles may come with every frame, new positions every few frames: a fix is a subtitle with a new
    position, or one a second while the drone stands still. Every fix is single. Heights are ``abs_alt``,
    above the sea and taken as ellipsoidal; in the older ``GPS(...)`` they are the barometer's, shifted to the
    level of the third number. A note says so.

    Raises:
        GpsLogError: No subtitle has a position, or one has an impossible time.
    """
    subtitles = _subtitles(data.decode("utf-8-sig", errors="replace"), path)
    found = [_row(number, t_s, text) for number, (t_s, text) in enumerate(subtitles, 1)]
    rows = [row for row in found if row is not None]
    if not rows:
        raise GpsLogError(
            f"{counted(len(subtitles), 'subtitle')}, none with a position",
            file=path,
            expected="[latitude: ...] [longitude: ...] or GPS(longitude,latitude,...), as of a DJI drone",
            remedy="enable video captions on the drone and fly with GPS",
        )
    height, notes = _heights(rows)
    new = _new(rows)
    fixes = [
        Fix(row.t_s, row.latitude_deg, row.longitude_deg, h, FixClass.SINGLE, row.number)
        for row, h, keep in zip(rows, height.tolist(), new, strict=True)
        if keep
    ]
    if len(rows) < len(found):
        notes.append(f"{counted(len(found) - len(rows), 'subtitle')} without a position skipped")
    if len(fixes) < len(rows):
        notes.append(f"{counted(len(rows) - len(fixes), 'subtitle')} with a repeated position skipped")
    return RawLog(Clock.VIDEO, fixes, notes)


def _subtitles(text: str, path: Path) -> list[tuple[float, str]]:
    """Return the start time [s] and the text of each subtitle."""
    try:
        parsed = list(srt.parse(text, ignore_errors=True))
    except OverflowError as error:
        raise GpsLogError(
            "a subtitle at an impossible time",
            file=path,
            expected="HH:MM:SS,mmm --> HH:MM:SS,mmm",
            remedy="remove that subtitle",
        ) from error
    return [(subtitle.start.total_seconds(), subtitle.content) for subtitle in parsed]


def _row(number: int, t_s: float, text: str) -> _Row | None:
    latitude, longitude, absolute = _number(_LATITUDE, text), _number(_LONGITUDE, text), np.nan
    old = _GPS.search(text)
    if old is not None:
        parts = [_float(part) for part in old[1].split(",")]
        longitude, latitude, absolute = (*parts, np.nan, np.nan, np.nan)[:3]
    else:
        absolute = _number(_ABSOLUTE, text)
    if np.isnan(latitude) or np.isnan(longitude) or latitude == longitude == 0.0:
        return None
    return _Row(
        number=number,
        t_s=t_s,
        latitude_deg=latitude,
        longitude_deg=longitude,
        absolute_m=absolute,
        relative_m=_number(_RELATIVE, text),
        old=old is not None,
    )


def _float(text: str) -> float:
    try:
        return float(text.strip().removesuffix("M"))
    except ValueError:
        return np.nan


def _number(pattern: re.Pattern[str], text: str) -> float:
    match = pattern.search(text)
    return np.nan if match is None else float(match[match.lastindex or 0])


def _heights(rows: list[_Row]) -> tuple[FloatArray, list[str]]:
    """Return (N,) heights and a note on them."""
    absolute, relative = np.array([[row.absolute_m, row.relative_m] for row in rows]).T
    both = np.isfinite(absolute) & np.isfinite(relative)
    if not np.isfinite(absolute).any():
        return relative, ["heights are above the take-off point but taken as ellipsoidal"]
    if both.all() and all(row.old for row in rows) and np.all(absolute == np.round(absolute)):
        level = float(np.median(absolute - relative))
        return relative + level, [
            "heights are the barometer's, shifted to the third number of GPS(...), which counts satellites "
            "on some drones: they may be wrong by hundreds of metres"
        ]
    return absolute, ["heights are above the sea but taken as ellipsoidal: they may be wrong by 100 m"]


def _new(rows: list[_Row]) -> list[bool]:
    """Return which rows are fixes: a new position, or the same one for another second."""
    kept: _Row | None = None
    new = []
    for row in rows:
        same = kept is not None and (row.latitude_deg, row.longitude_deg) == (
            kept.latitude_deg,
            kept.longitude_deg,
        )
        new.append(kept is None or not same or row.t_s - kept.t_s >= _STILL_S)
        kept = row if new[-1] else kept
    return new

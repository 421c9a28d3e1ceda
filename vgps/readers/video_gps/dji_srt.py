"""Subtitles that DJI drones write beside or into their videos: positions and heights at the video's times.

Newer drones write ``[latitude: 48.1] [longitude: 11.5] [rel_alt: 10.1 abs_alt: 530.2]`` (some spell
``longtitude``, some give one ``altitude``), older ones ``GPS(11.5,48.1,530) BAROMETER:10.1`` with the
longitude first. Some give no height, and some no times but a date a second.
"""

import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from vgps.errors import GpsLogError
from vgps.model import FixClass, FloatArray
from vgps.readers.gps_formats.fixes import (
    Clock,
    Fix,
    RawLog,
    counted,
    from_sea_level,
    skipped,
    with_a_height,
    without_repeats,
)
from vgps.readers.video.metadata_tracks import packets_of

_NUMBER = r"\s*[:=]?\s*([-+]?\d+(?:\.\d+)?)"
_LATITUDE, _LONGITUDE = re.compile(rf"latitude{_NUMBER}"), re.compile(rf"longt?itude{_NUMBER}")
_GPS = re.compile(r"GPS\s*:?\s*\(([^()]*)\)")
_ABSOLUTE = re.compile(rf"(?:abs_alt|\baltitude){_NUMBER}")
_RELATIVE = re.compile(rf"(?:rel_alt|BAROMETER|Hb){_NUMBER}|\bH\s+([-+]?\d+(?:\.\d+)?)\s*m\b")
_TIMES = re.compile(rb"\d\d:\d\d:\d\d[,.]\d{1,3}\s*-->\s*\d\d:\d\d:\d\d")
# subtitles without times: a number, a date, then the position
_DATE = r"\d{4}\.\d\d?\.\d\d?\s+\d\d?:\d\d:\d\d"
_DATED = re.compile(rf"^\d+\s*\n({_DATE})(?:[,.](\d{{1,3}}))?[\d,.]*[ \t]*$", re.MULTILINE)
_DATED_HEAD = re.compile(rf"\s*\d+\s*\n{_DATE}[^\n]*\n[^\n]*\[latitude".encode())
# bounded: the package srt takes minutes for some files of 6 kB
_START = re.compile(r"(\d{1,9}):(\d\d):(\d\d)[,.](\d{1,3})\s{0,9}-->[^\n]*")
_LONGEST_H = 10_000
_TEXT_TRACKS = ("tx3g", "text")  # of MP4 and MOV: texts behind their lengths
_LENGTH_BYTES = 2


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
    """Whether the file begins with the times of a subtitle, or with a dated one."""
    return _TIMES.search(data[:400]) is not None or _DATED_HEAD.match(data[:400]) is not None


def read_dji_srt(data: bytes, path: Path) -> RawLog:
    """Read a drone's subtitles onto the video's clock; ``line`` counts the subtitles.

    Subtitles may come with every frame, new positions every few frames: a fix is a subtitle with a new
    position, or one a second while the drone stands still. Every fix is single. Heights are ``abs_alt``,
    above the sea, plus the geoid's; in the older ``GPS(...)`` they are the barometer's, shifted to the level
    of the third number. Without any height a fix is horizontal: the origin's height is zero, with a standard
    deviation of 1 km. Without times of their own, subtitles are at their dates, from the first one's on.
    Notes say so.

    Raises:
        GpsLogError: No subtitle has a position, or one has an impossible time.
    """
    text = data.decode("utf-8-sig", errors="replace")
    subtitles = _subtitles(text, path)
    if subtitles:
        return fixes_of(subtitles, path)
    raw = fixes_of(_dated(text), path)
    return replace(raw, notes=["no time codes: times count from the date of the first subtitle", *raw.notes])


def read_subtitle_track(video: Path) -> RawLog | None:
    """Read the subtitles in a drone's video as those beside it; None without any that has a position.

    Raises:
        RecordingError: The video cannot be read.
    """
    subtitles = subtitles_in(video)
    return fixes_of(subtitles, video) if any(_row(0, *one) is not None for one in subtitles) else None


def subtitles_in(video: Path, most: int | None = None) -> list[tuple[float, str]]:
    """Return start time [s] and text of each subtitle in a video, or of so many at most.

    Raises:
        RecordingError: The video cannot be read.
    """
    found = []
    for packet in packets_of(video, *_TEXT_TRACKS, most=most):
        length = int.from_bytes(packet.data[:_LENGTH_BYTES], "big")
        text = packet.data[_LENGTH_BYTES : _LENGTH_BYTES + length]
        if text:  # gaps between subtitles are packets without one
            found.append((packet.start_s, text.decode("utf-8", errors="replace")))
    return found


def files_beside(video: Path) -> list[Path]:
    """Return the files of subtitles beside a video that have its name; mostly one or none."""
    files = (video.with_suffix(suffix) for suffix in (".srt", ".SRT"))
    return [file for file in files if file.is_file()]


def fixes_of(subtitles: list[tuple[float, str]], path: Path) -> RawLog:
    """Return the fixes of subtitles, start times [s] and texts.

    Raises:
        GpsLogError: None has a position.
    """
    found = [_row(number, t_s, text) for number, (t_s, text) in enumerate(subtitles, 1)]
    rows = [row for row in found if row is not None]
    if not rows:
        raise GpsLogError(
            f"{counted(len(subtitles), 'subtitle')}, none with a position",
            file=path,
            expected="[latitude: ...] [longitude: ...] or GPS(longitude,latitude,...), as of a DJI drone",
            remedy="enable video captions on the drone and fly with GPS",
        )
    height, above_sea, doubts = _heights(rows)
    fixes = [
        Fix(row.t_s, row.latitude_deg, row.longitude_deg, h, FixClass.SINGLE, row.number)
        for row, h in zip(rows, height.tolist(), strict=True)
    ]
    fixes, about_repeats = without_repeats(fixes, "subtitle")
    fixes, about_none = with_a_height(fixes)
    fixes, notes = from_sea_level(fixes) if above_sea else (fixes, [])
    notes += skipped(len(found) - len(rows), "subtitle", "without a position")
    return RawLog(Clock.VIDEO, fixes, [*about_none, *notes, *about_repeats], airborne=True, doubts=doubts)


def _subtitles(text: str, path: Path) -> list[tuple[float, str]]:
    """Return the start time [s] and the text of each subtitle."""
    starts = list(_START.finditer(text))
    if any(int(start[1]) > _LONGEST_H for start in starts):
        raise GpsLogError(
            "a subtitle at an impossible time",
            file=path,
            expected="HH:MM:SS,mmm --> HH:MM:SS,mmm",
            remedy="remove that subtitle",
        )
    ends = [start.start() for start in starts[1:]] + [len(text)]
    return [(_seconds(start), text[start.end() : end]) for start, end in zip(starts, ends, strict=False)]


def _seconds(start: re.Match[str]) -> float:
    hours, minutes, seconds = (int(start[group]) for group in (1, 2, 3))
    return 3600.0 * hours + 60.0 * minutes + seconds + float(f"0.{start[4]}")


def _dated(text: str) -> list[tuple[float, str]]:
    """Return seconds since the first date and the text of each dated subtitle."""
    dates = list(_DATED.finditer(text))
    ends = [match.start() for match in dates[1:]] + [len(text)]
    found = []
    for match, end in zip(dates, ends, strict=True):
        try:
            instant = datetime.strptime(match[1], "%Y.%m.%d %H:%M:%S").replace(tzinfo=UTC)
        except ValueError:
            continue  # no such day
        fraction_s = float(f"0.{match[2]}") if match[2] else 0.0
        found.append((instant.timestamp() + fraction_s, text[match.end() : end]))
    return [(t_s - found[0][0], content) for t_s, content in found]


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


def _heights(rows: list[_Row]) -> tuple[FloatArray, bool, list[str]]:
    """Return (N,) heights, whether they are above the sea, and doubts; NaN where there are none."""
    absolute, relative = np.array([[row.absolute_m, row.relative_m] for row in rows]).T
    both = np.isfinite(absolute) & np.isfinite(relative)
    if not (np.isfinite(absolute) | np.isfinite(relative)).any():
        return absolute, False, []
    if not np.isfinite(absolute).any():
        return relative, False, ["heights are above the take-off point but taken as ellipsoidal"]
    whole = np.all(absolute[both] == np.round(absolute[both]))
    if both.any() and all(row.old for row in rows) and whole:
        level = float(np.median((absolute - relative)[both]))
        note = (
            "heights are the barometer's, shifted to the third number of GPS(...), which counts satellites "
            "on some drones: they may be wrong by hundreds of metres"
        )
        return relative + level, False, [note]
    return absolute, True, []

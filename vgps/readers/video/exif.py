"""EXIF and XMP of pictures: when and where each one of a folder was taken.

Positions of a drone with RTK come with their class and standard deviations in DJI's XMP.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vgps.errors import VideoError
from vgps.model import FixClass, FloatArray
from vgps.readers.gps_formats.fixes import (
    EPOCH,
    Clock,
    Fix,
    RawLog,
    axis_sigmas,
    counted,
    from_sea_level,
    unix_s,
)
from vgps.readers.video.frame_times import FRAME_TIMES, FrameTimes

_EXIF_IFD, _GPS_IFD = 0x8769, 0x8825
_TAKEN, _SUBSECOND, _OFFSET = (0x9003, 0x9004), (0x9291, 0x9292), (0x9011, 0x9012)
_ZONE = re.compile(r"([+-])(\d\d):?(\d\d)")
_DAY_MINUTES = 24 * 60
_XMP_BYTES = 1 << 17  # at most two segments from the start
_XMP = re.compile(rb"drone-dji:(\w+)\s*(?:=\s*\"|>)\s*([-+]?\d+(?:\.\d+)?)")
# RtkFlag of DJI's drones
_RTK = {50: FixClass.RTK_FIX, 34: FixClass.RTK_FLOAT, 16: FixClass.SINGLE}


@dataclass(frozen=True, kw_only=True)
class Taken:
    """When and where a picture was taken; NaN and None where it does not say.

    Attributes:
        path: The picture.
        local: Its time, without a zone if it names none.
        utc_s: Unix time, by the GPS or by a zone.
        fix: Position with the time 0 and the row 0; None without one.
        above_sea: Whether the height is above the sea.
    """

    path: Path
    local: datetime | None
    utc_s: float
    fix: Fix | None
    above_sea: bool

    @property
    def utc(self) -> datetime | None:
        """The instant in UTC; None if the picture names no zone and has no GPS time."""
        return EPOCH + timedelta(seconds=self.utc_s) if np.isfinite(self.utc_s) else None


def read_taken(path: Path) -> Taken:
    """Read one picture; a damaged or missing part is left out."""
    try:
        with Image.open(path) as picture:
            exif = picture.getexif()
            details, gps = dict(exif.get_ifd(_EXIF_IFD)), dict(exif.get_ifd(_GPS_IFD))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        details, gps = {}, {}
    local, gps_s = _local(details), _gps_time(gps)
    utc_s = gps_s if np.isfinite(gps_s) or local is None or local.tzinfo is None else unix_s(local)
    with path.open("rb") as stream:
        dji = {key.decode(): float(value) for key, value in _XMP.findall(stream.read(_XMP_BYTES))}
    return Taken(path=path, local=local, utc_s=utc_s, fix=_fix(gps, dji), above_sea="RtkFlag" not in dji)


def picture_times(folder: Path, taken: Sequence[Taken]) -> FrameTimes:
    """Return the times [s] of pictures since the first one, in order of time.

    Pictures of the same instant, as cameras without fractions of seconds write them, are spread over it.

    Raises:
        VideoError: There are no pictures, or one has no time.
    """
    untimed = [one.path.name for one in taken if one.local is None]
    if not taken or untimed:
        found = f"{len(untimed)} of {len(taken)} images without a time" if taken else "no images"
        raise VideoError(
            found,
            file=folder,
            expected="DateTimeOriginal in each EXIF",
            remedy=f"add {FRAME_TIMES} with columns file,t_s or frame,t_s",
        )
    seconds = np.array([unix_s(one.local.replace(tzinfo=UTC)) for one in taken if one.local is not None])
    order = np.argsort(seconds, kind="stable")
    names = tuple(taken[k].path.name for k in order.tolist())
    return FrameTimes(_spread(seconds[order] - seconds.min()), names, folder)


def exif_fixes(taken: Sequence[Taken], t_s: FloatArray) -> RawLog:
    """Return the positions of pictures at the given times; ``line`` counts the pictures.

    Heights are above the sea, plus the geoid's, unless DJI's RTK gives them, which are ellipsoidal.
    """
    fixes = [
        one.fix._replace(t_s=float(t), line=row)
        for row, (one, t) in enumerate(zip(taken, t_s.tolist(), strict=True), 1)
        if one.fix is not None
    ]
    notes = []
    if 0 < len(fixes) < len(taken):
        notes.append(f"{counted(len(taken) - len(fixes), 'picture')} without a position")
    if fixes and any(one.above_sea for one in taken):
        fixes, about_heights = from_sea_level(fixes)
        notes += about_heights
    return RawLog(Clock.VIDEO, fixes, notes)


def _spread(t_s: FloatArray) -> FloatArray:
    """Return times (N,) of which equal ones share the time until the next, at most a second."""
    distinct, first, count = np.unique(t_s, return_index=True, return_counts=True)
    gap = np.minimum(np.diff(distinct, append=np.inf), 1.0)
    row = np.arange(len(t_s)) - np.repeat(first, count)
    return np.asarray(t_s + row * np.repeat(gap / count, count))


def _local(details: dict[int, Any]) -> datetime | None:
    for tag, part, zone in zip(_TAKEN, _SUBSECOND, _OFFSET, strict=True):
        try:
            instant = datetime.strptime(str(details[tag]).strip("\0 "), "%Y:%m:%d %H:%M:%S")
        except (KeyError, ValueError):
            continue
        digits = str(details.get(part, "")).strip("\0 ")
        if digits.isdecimal():
            instant += timedelta(seconds=float(f"0.{digits}"))
        found = _ZONE.match(str(details.get(zone, "")))
        if found:
            minutes = int(found[1] + "1") * (60 * int(found[2]) + int(found[3]))
            if abs(minutes) < _DAY_MINUTES:  # else no zone
                instant = instant.replace(tzinfo=timezone(timedelta(minutes=minutes)))
        return instant
    return None


def _gps_time(gps: dict[int, Any]) -> float:
    """Return the Unix time of GPSDateStamp and GPSTimeStamp; NaN without them."""
    try:
        day = datetime.strptime(str(gps[0x1D]).strip("\0 "), "%Y:%m:%d").replace(tzinfo=UTC)
        hour, minute, second = (float(part) for part in gps[0x07])
    except (KeyError, ValueError, TypeError, ZeroDivisionError):
        return np.nan
    return unix_s(day) + 3600.0 * hour + 60.0 * minute + second


def _fix(gps: dict[int, Any], dji: dict[str, float]) -> Fix | None:
    try:
        latitude = _degrees(gps[0x02]) * (-1.0 if str(gps.get(0x01, "N")).startswith("S") else 1.0)
        longitude = _degrees(gps[0x04]) * (-1.0 if str(gps.get(0x03, "E")).startswith("W") else 1.0)
        height = float(gps[0x06]) * (-1.0 if gps.get(0x05) in {b"\x01", 1} else 1.0)
    except (KeyError, ValueError, TypeError, ZeroDivisionError):
        return None
    if latitude == longitude == 0.0 or not np.isfinite([latitude, longitude, height]).all():
        return None
    east, north, up = axis_sigmas(_number(gps.get(0x1F)))
    sigma = (dji.get("RtkStdLon", east), dji.get("RtkStdLat", north), dji.get("RtkStdHgt", up))
    kind = FixClass.DGPS if _number(gps.get(0x1E)) == 1 else FixClass.SINGLE
    kind = _RTK.get(int(dji.get("RtkFlag", -1)), kind)
    return Fix(0.0, latitude, longitude, height, kind, 0, sigma, hdop=_number(gps.get(0x0B)))


def _degrees(parts: Any) -> float:
    degrees, minutes, seconds = (float(part) for part in parts)
    return degrees + minutes / 60.0 + seconds / 3600.0


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return float("nan")

"""Garmin FIT files of watches, bicycle computers and trackers, with fitdecode (the extra ``logs``)."""

import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.extras import optional_module
from vgps.readers.gps_formats.fixes import (
    Clock,
    Fix,
    RawLog,
    axis_sigmas,
    counted,
    from_sea_level,
    skipped,
    unix_s,
)

_SEMICIRCLE_DEG = 180.0 / 2**31


def looks_like_fit(data: bytes) -> bool:
    """Whether the header names the format."""
    return data[8:12] == b".FIT"


def read_fit(data: bytes, path: Path) -> RawLog:
    """Read the ``record`` messages in UTC, one a second at most; every fix is single.

    Altitudes are above the sea, plus the geoid's. ``gps_accuracy`` is taken as the horizontal sigma.

    Raises:
        GpsLogError: The file is damaged before its first position.
    """
    fitdecode = optional_module("fitdecode", "logs", path)
    fixes, bare, damaged = list[Fix](), 0, False
    try:
        for number, frame in enumerate(_frames(fitdecode, data), 1):
            fix = _fix(frame, number)
            bare += fix is None
            fixes += [] if fix is None else [fix]
    except Exception as error:  # fitdecode raises whatever damaged bytes lead to
        damaged = True
        if not fixes:
            raise GpsLogError(f"damaged FIT ({error})", file=path, remedy="copy it again") from error
    fixes, notes = from_sea_level(fixes)
    notes += skipped(bare, "record", "without a position")
    if damaged:
        notes.append(f"the file is damaged after {counted(len(fixes), 'fix')}")
    return RawLog(Clock.UTC, fixes, notes)


def _frames(fitdecode: ModuleType, data: bytes) -> Iterator[Any]:
    """Yield the ``record`` messages."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on every odd field of a damaged file
        with fitdecode.FitReader(io.BytesIO(data), check_crc=fitdecode.CrcCheck.DISABLED) as reader:
            for frame in reader:
                if frame.frame_type == fitdecode.FIT_FRAME_DATA and frame.name == "record":
                    yield frame


def _fix(frame: Any, number: int) -> Fix | None:
    def value(name: str) -> Any:
        return frame.get_value(name, fallback=None) if frame.has_field(name) else None

    latitude, longitude, when = value("position_lat"), value("position_long"), value("timestamp")
    altitude = value("enhanced_altitude")
    altitude = value("altitude") if altitude is None else altitude
    if latitude is None or longitude is None or when is None or altitude is None:
        return None
    return Fix(
        unix_s(when),
        latitude * _SEMICIRCLE_DEG,
        longitude * _SEMICIRCLE_DEG,
        float(altitude),
        FixClass.SINGLE,
        number,
        axis_sigmas(float(value("gps_accuracy") or 0.0)),
    )

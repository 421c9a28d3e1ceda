"""NMEA 0183 logs: GGA is the fix, GST its sigmas, GSA a DOP, ZDA or RMC the date."""

import math
import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date, time
from typing import Any

import numpy as np
from pynmeagps import NMEAReader
from pynmeagps.exceptions import NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError
from pynmeagps.nmeahelpers import calc_checksum

from vgps.crs import egm96
from vgps.model import FixClass, FloatArray
from vgps.readers.gps_formats.fixes import (
    DAY_S,
    NMEA_QUALITY,
    Clock,
    Fix,
    RawLog,
    counted,
    damaged_lines,
    skipped,
    unix_day_s,
)

_SENTENCE = re.compile(rb"\$[A-Z]{2}(GGA|GST|GSA|ZDA|RMC),[^$\r\n]*")
_OTHER = re.compile(rb"\s*[$!][A-Z][A-Z0-9]{2,},[^$]*\s*")
_LEAP_SECOND = re.compile(rb"235960(\.\d*)?")
_ERRORS = (NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError, ValueError, IndexError, KeyError)
_GGA_FIELDS = 15
_SEPARATION_LIMIT_M = 3.0  # EGM96 is within about a metre of the geoid, receivers' coarser tables within two
_ABSURD = re.compile(rb"\d{19}")  # more digits than a 64-bit integer has


@dataclass(kw_only=True)
class _Epoch:
    """A GGA sentence and its DOP; ``day`` counts midnights since the log's first sentence."""

    order: int
    line: int
    day: int
    time_s: float
    gga: Any
    hdop: float


@dataclass(frozen=True)
class _Anchor:
    """A sentence with a date; ``day_zero_s`` is the midnight at which the log's day 0 would begin."""

    order: int
    day: int
    time_s: float
    day_zero_s: float


@dataclass(kw_only=True)
class _Reading:
    """The sentences read so far."""

    epochs: list[_Epoch] = field(default_factory=list)
    anchors: list[_Anchor] = field(default_factory=list)
    sigmas: dict[tuple[int, int], tuple[float, float, float]] = field(default_factory=dict)
    damaged: list[int] = field(default_factory=list)
    untimed: int = 0
    day: int = 0
    time_s: float | None = None


def looks_like_nmea(data: bytes) -> bool:
    """Whether there is a GGA sentence, in text or between binary messages."""
    return re.search(rb"\$[A-Z]{2}GGA,", data) is not None


def read_nmea(data: bytes) -> RawLog:
    """Read an NMEA log; damaged sentences are skipped and counted, other data between them is ignored.

    Sentences are joined to epochs by their time of day, which may pass midnight. The date comes from ZDA or
    RMC, anywhere in the log; without one, times count from a midnight. Height is altitude plus geoid
    separation; a missing separation is taken from the other fixes, or from EGM96. Notes say so, and whether
    the receiver's separations contradict EGM96.
    """
    reading = _Reading()
    sentences = list(_sentences(data, reading.damaged))
    # a log without any checksums is accepted
    checked = any(b"*" in raw for _, _, raw in sentences)
    for order, (line, kind, raw) in enumerate(sentences):
        message = _parse(raw, checked)
        if message is None:
            reading.damaged.append(line)
        else:
            _take(reading, order, line, kind, message, raw)
    return _log(reading)


def _sentences(data: bytes, damaged: list[int]) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield line, kind and bytes of each sentence of interest."""
    binary = data.count(b"\0") > len(data) / 100  # messages of another protocol, not damage
    for number, line in enumerate(data.split(b"\n"), 1):
        found = list(_SENTENCE.finditer(line))
        yield from ((number, match[1], match[0].strip()) for match in found)
        known = found or binary or not line.strip() or line.startswith(b"#") or _OTHER.fullmatch(line)
        if not known:
            damaged.append(number)


def _parse(raw: bytes, checked: bool) -> Any | None:
    if not re.search(rb"\*[0-9A-Fa-f]{2}$", raw):
        if checked or b"*" in raw or not raw.isascii():
            return None
        raw += b"*" + calc_checksum(raw[1:].decode()).encode()
    if (raw[3:6] == b"GGA" and raw.count(b",") < _GGA_FIELDS - 1) or _ABSURD.search(raw):
        return None
    try:
        return NMEAReader.parse(raw + b"\r\n")
    except _ERRORS:
        return None


def _take(reading: _Reading, order: int, line: int, kind: bytes, message: Any, raw: bytes) -> None:
    if kind == b"GSA":
        if reading.epochs and math.isnan(reading.epochs[-1].hdop):
            reading.epochs[-1].hdop = _number(message, "HDOP")
        return
    time_s = _time_of_day(message, raw)
    if time_s is None:
        reading.untimed += kind == b"GGA"
        return
    if reading.time_s is not None:
        reading.day -= round((time_s - reading.time_s) / DAY_S)
    reading.time_s = time_s
    if kind == b"GGA":
        hdop = _number(message, "HDOP")
        reading.epochs.append(
            _Epoch(order=order, line=line, day=reading.day, time_s=time_s, gga=message, hdop=hdop)
        )
    elif kind == b"GST":
        sigmas = [_number(message, name) for name in ("stdLong", "stdLat", "stdAlt")]
        reading.sigmas[_key(reading.day, time_s)] = (sigmas[0], sigmas[1], sigmas[2])
    elif (day := _date(kind, message)) is not None:
        zero = unix_day_s(day) - reading.day * DAY_S
        reading.anchors.append(_Anchor(order, reading.day, time_s, zero))


def _key(day: int, time_s: float) -> tuple[int, int]:
    return day, round(time_s * 1000)


def _number(message: Any, name: str) -> float:
    value = getattr(message, name, "")
    return float(value) if isinstance(value, int | float) else np.nan


def _time_of_day(message: Any, raw: bytes) -> float | None:
    value = getattr(message, "time", None)
    if isinstance(value, time):
        return value.hour * 3600 + value.minute * 60 + value.second + value.microsecond * 1e-6
    leap = _LEAP_SECOND.fullmatch(raw.split(b",")[1])
    return DAY_S + float(leap[1] or 0) if leap else None


def _date(kind: bytes, message: Any) -> date | None:
    if kind == b"RMC":
        # before its first fix a receiver may give the date of its firmware
        valid = getattr(message, "status", "") == "A" and isinstance(getattr(message, "date", None), date)
        return message.date if valid else None
    try:
        return date(int(message.year), int(message.month), int(message.day))
    except (ValueError, OverflowError, TypeError, AttributeError):
        return None


def _log(reading: _Reading) -> RawLog:
    with_fix = [epoch for epoch in reading.epochs if _number(epoch.gga, "quality") > 0]
    separations = np.array([_number(epoch.gga, "sep") for epoch in with_fix])
    model = _model_separations(with_fix)
    known = np.isfinite(separations)
    instead = np.full(len(with_fix), np.median(separations[known])) if known.any() else model
    filled = np.where(known, separations, instead)
    fixes = [
        _fix(epoch, reading, separation) for epoch, separation in zip(with_fix, filled.tolist(), strict=True)
    ]
    notes = [
        *damaged_lines(reading.damaged),
        *skipped(len(reading.epochs) - len(with_fix), "epoch", "without a fix"),
        *skipped(reading.untimed, "fix", "without a time of day"),
    ]
    if not known.all():
        source = "as in the others" if known.any() else "from EGM96: heights may be wrong by a metre"
        height = f"{np.nanmedian(instead):g} m" if known.any() else f"{np.nanmedian(instead):.1f} m"
        notes.append(
            f"{counted(int((~known).sum()), 'fix')} without geoid separation, taken as {height} {source}"
        )
    notes += _contradiction(separations[known], model[known])
    return RawLog(Clock.UTC if reading.anchors else Clock.TIME_OF_DAY, fixes, notes)


def _model_separations(epochs: list[_Epoch]) -> FloatArray:
    """Return (N,) heights of EGM96 at the fixes; NaN where a position is impossible."""
    place = np.array([[_number(epoch.gga, name) for name in ("lat", "lon")] for epoch in epochs])
    place = place.reshape(-1, 2)
    place[(np.abs(place) > (90.0, 360.0)).any(axis=1)] = np.nan
    return egm96().height_m(*place.T)


def _contradiction(separations: FloatArray, model: FloatArray) -> list[str]:
    """Return a note if the receiver's geoid separations are not those of a geoid."""
    difference = separations - model
    if not np.isfinite(difference).any() or abs(np.nanmedian(difference)) < _SEPARATION_LIMIT_M:
        return []
    return [
        f"the receiver's geoid separation, {np.median(separations):.1f} m, contradicts EGM96's "
        f"{np.nanmedian(model):.1f} m: heights are right if the receiver subtracts the same from its own, "
        "else wrong by the difference"
    ]


def _fix(epoch: _Epoch, reading: _Reading, separation_m: float) -> Fix:
    gga = epoch.gga
    return Fix(
        t_s=_day_zero(epoch, reading.anchors) + epoch.day * DAY_S + epoch.time_s,
        latitude_deg=_number(gga, "lat"),
        longitude_deg=_number(gga, "lon"),
        height_m=_number(gga, "alt") + separation_m,
        fix_class=NMEA_QUALITY.get(int(gga.quality), FixClass.UNKNOWN),
        line=epoch.line,
        sigma_m=reading.sigmas.get(_key(epoch.day, epoch.time_s), (np.nan, np.nan, np.nan)),
        hdop=epoch.hdop,
        satellites=_number(gga, "numSV"),
        correction_age_s=_number(gga, "diffAge"),
    )


def _day_zero(epoch: _Epoch, anchors: list[_Anchor]) -> float:
    """Return the midnight of day 0: from the date in the same epoch, else before it, else after it."""
    if not anchors:
        return 0.0
    after = bisect_right(anchors, epoch.order, key=lambda anchor: anchor.order)
    following = anchors[after] if after < len(anchors) else None
    if following is not None and (
        after == 0 or _key(following.day, following.time_s) == _key(epoch.day, epoch.time_s)
    ):
        return following.day_zero_s
    return anchors[after - 1].day_zero_s

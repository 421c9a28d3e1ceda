"""u-blox binary logs: NAV-PVT is the fix, with its class and accuracy; in older ones NAV-SOL.

NAV-HPPOSLLH refines the position of the same epoch to 0.1 mm, NAV-DOP gives its HDOP. NMEA, RTCM and raw
measurements between them are ignored, so that an epoch that also has a GGA is one fix.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from pyubx2 import UBXMessageError, UBXParseError, UBXReader, UBXStreamError, UBXTypeError

from vgps.geodesy import ecef_to_geodetic
from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, axis_sigmas, counted, skipped, unix_s
from vgps.readers.gps_formats.leap_seconds import GPS_EPOCH_S, WEEK_S, utc_from_gps

_NAV_PVT = b"\xb5\x62\x01\x07"
_NAV_SOL = b"\xb5\x62\x01\x06\x34\x00"  # with its length
_MESSAGES = rb"\xb5\x62\x01([%s])(..)"  # of these numbers, and the length
_WITH_PVT, _WITH_SOL = b"\x07\x14\x04", b"\x06\x02\x04"  # NAV-PVT, HPPOSLLH, DOP; NAV-SOL, POSLLH, DOP
_TOW_AT = {"NAV-HPPOSLLH": 4}  # offset of the time of week in the payload, else 0
_LEAST_BYTES = {  # of a payload in the oldest protocol
    "NAV-PVT": 84,
    "NAV-HPPOSLLH": 36,
    "NAV-DOP": 18,
    "NAV-SOL": 52,
    "NAV-POSLLH": 28,
}
_MOST_BYTES = 200  # of these payloads in any protocol; a damaged length would cost the check sum of 64 kB
_ERRORS = (UBXMessageError, UBXParseError, UBXStreamError, UBXTypeError, ValueError, struct.error)
_HALF_WEEK_MS = 302_400_000
_FRAME = 8  # bytes around a payload
_GNSS = {2, 3, 4}  # 2D, 3D, with dead reckoning
_FIXED, _FLOAT = 2, 1

_Epoch = tuple[int, int]  # weeks since the log's first, time of week in ms


@dataclass
class _Reading:
    """Messages by epoch, and the number of damaged ones."""

    fixes: list[tuple[_Epoch, Any, int]] = field(default_factory=list)
    precise: dict[_Epoch, Any] = field(default_factory=dict)
    dilution: dict[_Epoch, Any] = field(default_factory=dict)
    damaged: int = 0


def looks_like_ubx(data: bytes) -> bool:
    """Whether there is a NAV-PVT message, alone or between NMEA and RTCM."""
    return _NAV_PVT in data


def read_ubx(data: bytes) -> RawLog:
    """Read the NAV-PVT messages, in UTC, with ellipsoidal heights; ``line`` counts these messages.

    Carrier-phase solutions are RTK classes, differential ones DGPS. ``sigma_m`` is hAcc, split evenly between
    east and north, and vAcc. ``hdop`` is NAV-DOP's, or else NAV-PVT's PDOP, which is never smaller. Damaged
    messages are skipped and counted.
    """
    reading = _read(data, _WITH_PVT)
    fixes, undated, unresolved, lost = [], 0, 0, 0
    for epoch, message, number in reading.fixes:
        minute = _minute(message)
        if minute is None:
            undated += 1
        elif not message.gnssFixOk or getattr(message, "invalidLlh", False):
            lost += 1
        else:
            unresolved += not message.fullyResolved
            more = reading.precise.get(epoch), reading.dilution.get(epoch)
            fixes.append(_fix(message, number, unix_s(minute), *more))
    notes = [
        *skipped(reading.damaged, "damaged message"),
        *skipped(undated, "message", "before the receiver knew the time"),
        *skipped(lost, "message", "without a fix"),
    ]
    if unresolved:
        before = f"{counted(unresolved, 'fix')} before the receiver knew the leap seconds"
        notes.append(f"{before}: times may be wrong by whole seconds")
    return RawLog(Clock.UTC, fixes, notes)


def looks_like_old_ubx(data: bytes) -> bool:
    """Whether there is a NAV-SOL message."""
    return _NAV_SOL in data


def read_old_ubx(data: bytes) -> RawLog:
    """Read the NAV-SOL messages of receivers before NAV-PVT, u-blox 4 to 6, or of later ones set to them.

    They have ECEF coordinates in cm, GPS time and the class: single or DGPS. NAV-POSLLH of the same epoch
    refines the position to 1 mm and gives ``sigma_m``, NAV-DOP the HDOP. Damaged messages are skipped and
    counted.
    """
    reading = _read(data, _WITH_SOL)
    good = [row for row in reading.fixes if row[1].gpsfixOK and row[1].wknSet and row[1].towSet]
    messages = [message for _, message, _ in good]
    place = np.array([(each.ecefX, each.ecefY, each.ecefZ) for each in messages], float).reshape(-1, 3)
    geodetic = ecef_to_geodetic(place * 1e-2).tolist()
    weeks_s = [GPS_EPOCH_S + each.week * WEEK_S + each.fTOW * 1e-9 for each in messages]
    tow_s = [tow * 1e-3 for (_, tow), _, _ in good]
    t_s = utc_from_gps(np.array(weeks_s) + np.array(tow_s)).tolist()
    fixes = [
        _old_fix(message, number, (t, *where), (reading.precise.get(epoch), reading.dilution.get(epoch)))
        for (epoch, message, number), t, where in zip(good, t_s, geodetic, strict=True)
    ]
    notes = [
        *skipped(reading.damaged, "damaged message"),
        *skipped(
            len(reading.fixes) - len(good), "message", "without a fix or before the receiver knew the time"
        ),
    ]
    return RawLog(Clock.UTC, fixes, notes)


def _old_fix(
    message: Any, number: int, place: tuple[float, float, float, float], more: tuple[Any | None, Any | None]
) -> Fix:
    precise, dilution = more
    t_s, latitude, longitude, height = place
    sigma_m = (np.nan, np.nan, np.nan)
    if precise is not None:
        latitude, longitude, height = precise.lat, precise.lon, precise.height * 1e-3
        sigma_m = axis_sigmas(precise.hAcc * 1e-3, precise.vAcc * 1e-3)
    kind = FixClass.DGPS if message.diffSoln else FixClass.SINGLE
    return Fix(
        t_s=t_s,
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        fix_class=kind if message.gpsFix in _GNSS else FixClass.UNKNOWN,
        line=number,
        sigma_m=sigma_m,
        hdop=float(message.pDOP if dilution is None else dilution.hDOP),
        satellites=float(message.numSV),
    )


def _read(data: bytes, numbers: bytes) -> _Reading:
    """Read the messages of these numbers: the fix, the precise position, the DOP."""
    reading = _Reading()
    weeks, number = 0, 0
    tow_before: int | None = None
    for message in _messages(data, numbers):
        if message is None:
            reading.damaged += 1
            continue
        (tow,) = struct.unpack_from("<I", message.payload, _TOW_AT.get(message.identity, 0))
        if tow_before is not None and tow < tow_before - _HALF_WEEK_MS:
            weeks += 1
        tow_before = tow
        if message.identity in {"NAV-PVT", "NAV-SOL"}:
            number += 1
            reading.fixes.append(((weeks, tow), message, number))
        elif message.identity == "NAV-DOP":
            reading.dilution[weeks, tow] = message
        elif not getattr(message, "invalidLlh", False):
            reading.precise[weeks, tow] = message
    return reading


def _messages(data: bytes, numbers: bytes) -> Iterator[Any | None]:
    """Yield the messages of these numbers; None for a wrong length or checksum.

    Only these are parsed, since a log with raw measurements is ten times as long.
    """
    for match in re.finditer(_MESSAGES % numbers, data, re.DOTALL):
        length = int.from_bytes(match[2], "little")
        if length > _MOST_BYTES:
            yield None
            continue
        try:
            message = UBXReader.parse(data[match.start() : match.start() + length + _FRAME])
        except _ERRORS:
            yield None
        else:
            # fields that a short message lacks are parsed as zero
            yield message if length >= _LEAST_BYTES[message.identity] else None


def _minute(message: Any) -> datetime | None:
    """Return the date and minute of a message; None if it has none or an impossible one."""
    if not (message.validDate and message.validTime):
        return None
    try:
        return datetime(message.year, message.month, message.day, message.hour, message.min, tzinfo=UTC)
    except ValueError:
        return None


def _fix(message: Any, number: int, minute_s: float, precise: Any | None, dilution: Any | None) -> Fix:
    place = message if precise is None else precise
    return Fix(
        t_s=minute_s + message.second + message.nano * 1e-9,
        latitude_deg=place.lat,
        longitude_deg=place.lon,
        height_m=place.height * 1e-3,
        fix_class=_class(message),
        line=number,
        sigma_m=axis_sigmas(place.hAcc * 1e-3, place.vAcc * 1e-3),
        hdop=float(message.pDOP if dilution is None else dilution.hDOP),
        satellites=float(message.numSV),
    )


def _class(message: Any) -> FixClass:
    if message.carrSoln == _FIXED:
        return FixClass.RTK_FIX
    if message.carrSoln == _FLOAT:
        return FixClass.RTK_FLOAT
    if message.fixType not in _GNSS:
        return FixClass.UNKNOWN
    return FixClass.DGPS if message.diffSoln else FixClass.SINGLE

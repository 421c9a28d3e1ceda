"""u-blox binary logs: NAV-PVT is the fix, with its class and accuracy.

NAV-HPPOSLLH refines the position of the same epoch to 0.1 mm, NAV-DOP gives its HDOP. NMEA, RTCM and raw
measurements between them are ignored, so that an epoch that also has a GGA is one fix.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from pyubx2 import UBXMessageError, UBXParseError, UBXReader, UBXStreamError, UBXTypeError

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, axis_sigmas, counted, skipped, unix_s

_NAV_PVT = b"\xb5\x62\x01\x07"
_MESSAGE = re.compile(rb"\xb5\x62\x01([\x07\x14\x04])(..)", re.DOTALL)  # PVT, HPPOSLLH, DOP and the length
_TOW_AT = {"NAV-PVT": 0, "NAV-HPPOSLLH": 4, "NAV-DOP": 0}  # offset of the time of week in the payload
_LEAST_BYTES = {"NAV-PVT": 84, "NAV-HPPOSLLH": 36, "NAV-DOP": 18}  # of a payload in the oldest protocol
_MOST_BYTES = 200  # of these payloads in any protocol; a damaged length would cost the check sum of 64 kB
_ERRORS = (UBXMessageError, UBXParseError, UBXStreamError, UBXTypeError, ValueError, struct.error)
_HALF_WEEK_MS = 302_400_000
_FRAME = 8  # bytes around a payload
_GNSS_3D, _GNSS_2D, _GNSS_AND_DEAD_RECKONING = 3, 2, 4
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
    reading = _read(data)
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


def _read(data: bytes) -> _Reading:
    reading = _Reading()
    weeks, number = 0, 0
    tow_before: int | None = None
    for message in _messages(data):
        if message is None:
            reading.damaged += 1
            continue
        (tow,) = struct.unpack_from("<I", message.payload, _TOW_AT[message.identity])
        if tow_before is not None and tow < tow_before - _HALF_WEEK_MS:
            weeks += 1
        tow_before = tow
        if message.identity == "NAV-PVT":
            number += 1
            reading.fixes.append(((weeks, tow), message, number))
        elif message.identity == "NAV-DOP":
            reading.dilution[weeks, tow] = message
        elif not message.invalidLlh:
            reading.precise[weeks, tow] = message
    return reading


def _messages(data: bytes) -> Iterator[Any | None]:
    """Yield NAV-PVT, NAV-HPPOSLLH and NAV-DOP messages; None for a wrong length or checksum.

    Only these are parsed, since a log with raw measurements is ten times as long.
    """
    for match in _MESSAGE.finditer(data):
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
    if message.fixType not in {_GNSS_2D, _GNSS_3D, _GNSS_AND_DEAD_RECKONING}:
        return FixClass.UNKNOWN
    return FixClass.DGPS if message.diffSoln else FixClass.SINGLE

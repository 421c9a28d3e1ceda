"""u-blox binary logs: NAV-PVT is the fix, with its class and its own accuracy; the rest is passed over."""

import io
import logging
from datetime import UTC, datetime
from typing import Any

import numpy as np
from pyubx2 import UBX_PROTOCOL, UBXReader

from vgps.model import FixClass
from vgps.readers.fixes import Clock, Fix, RawLog, unix_s

_NAV_PVT = b"\xb5\x62\x01\x07"
_GNSS_3D, _GNSS_2D, _GNSS_AND_DEAD_RECKONING = 3, 2, 4
_HORIZONTAL = 2.0**-0.5  # of a horizontal accuracy, on each axis


def looks_like_ubx(data: bytes) -> bool:
    """Whether there is a NAV-PVT message, alone or between NMEA and RTCM."""
    return _NAV_PVT in data


def read_ubx(data: bytes) -> RawLog:
    """Fixes of the NAV-PVT messages, in UTC, heights ellipsoidal; ``line`` counts these messages.

    Carrier solutions are RTK classes, differential ones DGPS. Positions have the message's seven digits, a
    centimetre. Damaged messages are passed over.
    """
    fixes, number, undated = [], 0, 0
    level = logging.getLogger("pyubx2").level
    logging.getLogger("pyubx2").setLevel(logging.CRITICAL)  # it logs each damaged message
    try:
        for _, message in UBXReader(io.BytesIO(data), protfilter=UBX_PROTOCOL, quitonerror=0):
            if message is None or message.identity != "NAV-PVT":
                continue
            number += 1
            if not (message.validDate and message.validTime):
                undated += 1
            elif message.gnssFixOk and not getattr(message, "invalidLlh", 0):
                fixes.append(_fix(message, number))
    finally:
        logging.getLogger("pyubx2").setLevel(level)
    notes = [f"{undated} messages before the receiver knew the time passed over"] if undated else []
    lost = number - undated - len(fixes)
    if lost:
        notes.append(f"{lost} messages without a fix passed over")
    return RawLog(Clock.UTC, fixes, notes)


def _fix(message: Any, number: int) -> Fix:
    minute = datetime(message.year, message.month, message.day, message.hour, message.min, tzinfo=UTC)
    horizontal_m, vertical_m = message.hAcc * 1e-3, message.vAcc * 1e-3
    sigma = (horizontal_m * _HORIZONTAL, horizontal_m * _HORIZONTAL, vertical_m)
    return Fix(
        t_s=unix_s(minute) + message.second + message.nano * 1e-9,
        latitude_deg=message.lat,
        longitude_deg=message.lon,
        height_m=message.height * 1e-3,
        fix_class=_class(message),
        line=number,
        sigma_m=sigma if horizontal_m > 0 and vertical_m > 0 else (np.nan, np.nan, np.nan),
        satellites=float(message.numSV),
    )


def _class(message: Any) -> FixClass:
    if message.carrSoln == 2:
        return FixClass.RTK_FIX
    if message.carrSoln == 1:
        return FixClass.RTK_FLOAT
    if message.fixType not in {_GNSS_2D, _GNSS_3D, _GNSS_AND_DEAD_RECKONING}:
        return FixClass.UNKNOWN
    return FixClass.DGPS if message.diffSoln else FixClass.SINGLE

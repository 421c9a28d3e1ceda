"""Logs of ArduPilot and PX4: telemetry (.tlog, with pymavlink of the extra ``logs``) and dataflash (.bin)."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.extras import optional_module, quiet
from vgps.readers.gps_formats.dataflash import SYNC, dataflash_messages
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, axis_sigmas, counted, from_sea_level, skipped
from vgps.readers.gps_formats.leap_seconds import utc_of_week

_STARTS = (0xFE, 0xFD)  # of a message of MAVLink 1 and 2, behind a time of eight bytes
_LEAST_US, _LAST_US = 1_000_000_000_000_000, 10_000_000_000_000_000  # of telemetry logs: 2001 to 2286
_CLASSES = {
    2: FixClass.SINGLE,
    3: FixClass.SINGLE,
    4: FixClass.DGPS,
    5: FixClass.RTK_FLOAT,
    6: FixClass.RTK_FIX,
    7: FixClass.UNKNOWN,  # static
    8: FixClass.PPP,
}
_LEAST_FIX = 2
Read = tuple[Fix, bool] | None  # and whether its height is above the sea
_UNKNOWN_U16 = 65535


def looks_like_mavlink(data: bytes) -> bool:
    """Whether the file begins as a dataflash log, or as a telemetry log with a time before a message."""
    if data.startswith(SYNC):
        return True
    return len(data) > 9 and data[8] in _STARTS and _LEAST_US < int.from_bytes(data[:8], "big") < _LAST_US


def fix_class(fix_type: int) -> FixClass:
    """Return the class of MAVLink's GPS_FIX_TYPE."""
    return _CLASSES.get(fix_type, FixClass.UNKNOWN)


def read_mavlink(data: bytes, path: Path) -> RawLog:
    """Read the first GPS in UTC: ``GPS_RAW_INT`` of telemetry, ``GPS`` of dataflash logs.

    Telemetry without an instant of its own is at the time at which the ground station stored it. Heights are
    ellipsoidal where the message has them, else above the sea plus the geoid's.

    Raises:
        GpsLogError: There is no GPS, or none had a fix.
    """
    name, read, messages = "GPS_RAW_INT", _telemetry, _telemetry_messages(path)
    if data.startswith(SYNC):
        name, read = "GPS", _dataflash
        messages = (one for one in dataflash_messages(data, "GPS") if getattr(one, "I", 0) == 0)
    all_read = [_whole(read, one, row) for row, one in enumerate(messages, 1)]
    found = [fix for fix in all_read if fix is not None]
    if not found:
        raise GpsLogError(f"{counted(len(all_read), 'message')} {name}, none with a fix", file=path)
    notes = skipped(len(all_read) - len(found), "message", "without a fix")
    fixes = [fix for fix, _ in found]
    if any(above_sea for _, above_sea in found):
        fixes, about_heights = from_sea_level(fixes)
        notes += about_heights
    return RawLog(Clock.UTC, fixes, notes)


def _telemetry_messages(path: Path) -> Iterator[Any]:
    """Yield the GPS_RAW_INT messages; pymavlink reads from a file only, and prints what it does not know."""
    kind = optional_module("pymavlink.mavutil", "logs", path).mavlogfile
    with quiet():
        log = kind.__new__(kind)
        try:
            # a damaged end raises whatever its bytes lead to; what was read before stays
            with contextlib.suppress(Exception):
                log.__init__(str(path))
                while (message := log.recv_match(type=["GPS_RAW_INT"])) is not None:
                    yield message
        finally:
            # the constructor of a damaged file fails with the file open
            with contextlib.suppress(AttributeError):
                log.close()


def _whole(read: Callable[[Any, int], Read], message: Any, number: int) -> Read:
    """Return what a message holds; None if it has no fix, or lost a field to damage."""
    try:
        return read(message, number)
    except (AttributeError, TypeError, ValueError):
        return None


def _dataflash(message: Any, number: int) -> Read:
    if message.Status < _LEAST_FIX or message.GWk <= 0:
        return None
    fix = Fix(
        utc_of_week(message.GWk, message.GMS * 1e-3),
        float(message.Lat),
        float(message.Lng),
        float(message.Alt),
        fix_class(int(message.Status)),
        number,
        hdop=float(message.HDop),
        satellites=float(message.NSats),
    )
    return fix, True


def _telemetry(message: Any, number: int) -> Read:
    if message.fix_type < _LEAST_FIX:
        return None
    own = message.time_usec > _LEAST_US  # else since the autopilot started
    ellipsoid_m = getattr(message, "alt_ellipsoid", 0) * 1e-3
    fix = Fix(
        message.time_usec * 1e-6 if own else float(message._timestamp),
        message.lat * 1e-7,
        message.lon * 1e-7,
        ellipsoid_m or message.alt * 1e-3,
        fix_class(int(message.fix_type)),
        number,
        axis_sigmas(getattr(message, "h_acc", 0) * 1e-3, getattr(message, "v_acc", 0) * 1e-3),
        hdop=np.nan if message.eph == _UNKNOWN_U16 else message.eph / 100.0,
        satellites=float(message.satellites_visible),
    )
    return fix, not ellipsoid_m

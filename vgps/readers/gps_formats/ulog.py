"""PX4's ULog files, with pyulog (the extra ``logs``)."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from vgps.errors import GpsLogError
from vgps.model import FloatArray
from vgps.readers.extras import optional_module, quiet
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, axis_sigmas, counted, skipped
from vgps.readers.gps_formats.mavlink import fix_class

_TOPICS = ("sensor_gps", "vehicle_gps_position")
_NEEDED = {"time_utc_usec", "fix_type"}
_HEADER_BYTES = 16
_KINDS = frozenset(bytes([kind]) for kind in b"BFIMPQARDLCSO")  # of messages
_LEAST_FIX = 2  # fix_type from here on is a position


def looks_like_ulog(data: bytes) -> bool:
    """Whether the file begins with ULog's magic bytes."""
    return data.startswith(b"ULog\x01\x12\x35")


def read_ulog(data: bytes, path: Path) -> RawLog:
    """Read ``sensor_gps`` or ``vehicle_gps_position`` (instance 0) in UTC; heights are ellipsoidal.

    Raises:
        GpsLogError: The file is damaged, or has no such topic or no UTC.
    """
    pyulog = optional_module("pyulog", "logs", path)
    try:
        with quiet():
            log = pyulog.ULog(io.BytesIO(data[: _end(data)]), list(_TOPICS))
    except Exception as error:  # pyulog raises whatever damaged bytes lead to
        raise GpsLogError(f"damaged ULog ({error})", file=path, remedy="copy it again") from error
    topics = {one.name: one.data for one in log.data_list if one.multi_id == 0}
    found = next((topics[name] for name in _TOPICS if name in topics), None)
    if found is None or not found.keys() >= _NEEDED:
        raise GpsLogError("no GPS", file=path, expected=f"a topic {' or '.join(_TOPICS)} with its fields")
    utc_s = found["time_utc_usec"].astype(np.float64) * 1e-6
    good = (found["fix_type"] >= _LEAST_FIX) & (utc_s > 1e9)
    rows = np.flatnonzero(good)
    if not len(rows):
        raise GpsLogError(f"{counted(len(good), 'position')}, none with a fix and UTC", file=path)
    fixes = [_fix(found, int(row), float(utc_s[row])) for row in rows]
    return RawLog(Clock.UTC, fixes, skipped(int((~good).sum()), "message", "without a fix or UTC"))


def _end(data: bytes) -> int:
    """Return where the chain of whole messages ends; behind it pyulog's search for more may never end."""
    at = _HEADER_BYTES
    while at + 3 <= len(data) and data[at + 2 : at + 3] in _KINDS:
        following = at + 3 + int.from_bytes(data[at : at + 2], "little")
        if following > len(data):
            break
        at = following
    return at


def _fix(topic: dict[str, Any], row: int, t_s: float) -> Fix:
    return Fix(
        t_s,
        _scaled(topic, row, ("latitude_deg", 1.0), ("lat", 1e-7)),
        _scaled(topic, row, ("longitude_deg", 1.0), ("lon", 1e-7)),
        _scaled(topic, row, ("altitude_ellipsoid_m", 1.0), ("alt_ellipsoid", 1e-3)),
        fix_class(int(topic["fix_type"][row])),
        row + 1,
        axis_sigmas(_value(topic, "eph", row), _value(topic, "epv", row)),
        hdop=_value(topic, "hdop", row),
        satellites=_value(topic, "satellites_used", row),
    )


def _scaled(topic: dict[str, Any], row: int, *names: tuple[str, float]) -> float:
    """Return the first of the fields that the topic has, by its scale; their names changed with PX4 1.14."""
    return next((_value(topic, name, row) * scale for name, scale in names if name in topic), np.nan)


def _value(topic: dict[str, FloatArray], name: str, row: int) -> float:
    return float(topic[name][row]) if name in topic else np.nan

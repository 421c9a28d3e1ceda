"""NovAtel's OEM logs, ASCII and binary, with novatel_edie (the extra ``logs``): BESTPOS."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vgps.model import FixClass
from vgps.readers.extras import optional_module
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, skipped
from vgps.readers.gps_formats.leap_seconds import utc_of_week

# a message in ASCII with its check sum, or the header of a binary one: their lengths, and the number 42
_BESTPOS = re.compile(
    rb"#BESTPOSA,(?:[^#*\r\n]{0,999}\*[0-9a-fA-F]{8})?|\xaaD\x12(.)\x2a\x00..(..)", re.DOTALL
)
_CHECK_BYTES, _LONGEST = 4, 500  # of a binary message
_COMPUTED = 0
_CLASSES = {
    16: FixClass.SINGLE,
    17: FixClass.DGPS,
    18: FixClass.SBAS,
    32: FixClass.RTK_FLOAT,
    34: FixClass.RTK_FLOAT,
    48: FixClass.RTK_FIX,
    49: FixClass.RTK_FLOAT,  # wide-lane ambiguities: decimetres
    50: FixClass.RTK_FIX,
    52: FixClass.SBAS,
    53: FixClass.SINGLE,
    54: FixClass.DGPS,
    55: FixClass.RTK_FLOAT,
    56: FixClass.RTK_FIX,
    68: FixClass.PPP,
    69: FixClass.PPP,
    73: FixClass.PPP,
    74: FixClass.PPP,
}


def looks_like_novatel(data: bytes) -> bool:
    """Whether there is a BESTPOS, in ASCII or binary, in the first megabyte."""
    return _BESTPOS.search(data[: 1 << 20]) is not None


def read_novatel(data: bytes, path: Path) -> RawLog:
    """Read the BESTPOS messages onto UTC; heights are ellipsoidal by the undulation that each has.

    Damaged messages are skipped and counted, others ignored.

    Raises:
        GpsLogError: novatel_edie is not installed.
    """
    positions = list(_positions(data, path))
    fixes = [
        _fix(message, row)
        for row, message in enumerate(positions, 1)
        if int(message.solution_status) == _COMPUTED
    ]
    damaged = max(0, len(_BESTPOS.findall(data)) - len(positions))
    notes = [
        *skipped(damaged, "damaged message"),
        *skipped(len(positions) - len(fixes), "epoch", "without a fix"),
    ]
    return RawLog(Clock.UTC, fixes, notes)


def _positions(data: bytes, path: Path) -> Iterator[Any]:
    """Yield the whole messages; only what begins as one is given to the parser, which is slow on noise."""
    optional_module("novatel_edie", "logs", path).disable_internal_logging()  # of what is damaged
    parser = optional_module("novatel_edie.oem", "logs", path).Parser()
    for match in _BESTPOS.finditer(data):
        text = match[0] + b"\r\n"
        if match[1] is not None:
            length = match[1][0] + int.from_bytes(match[2], "little") + _CHECK_BYTES
            text = data[match.start() : match.start() + min(length, _LONGEST)]
        parser.write(text)
        yield from (one for one in parser if getattr(one, "name", "") == "BESTPOS")
        parser.flush()


def _fix(message: Any, row: int) -> Fix:
    values = message.to_dict()
    # the name changed with the firmware
    above_geoid_m = values["orthometric_height"] if "orthometric_height" in values else values["height"]
    return Fix(
        utc_of_week(message.header.week, message.header.milliseconds * 1e-3),
        message.latitude,
        message.longitude,
        above_geoid_m + message.undulation,
        _CLASSES.get(int(message.position_type), FixClass.UNKNOWN),
        row,
        (message.longitude_std_dev, message.latitude_std_dev, message.height_std_dev),
        satellites=float(message.num_soln_svs),
        correction_age_s=message.diff_age,
    )

"""Kinematic positions of CSRS-PPP, the Canadian online service (``.pos``), with the columns of its header.

A line ``DIR FRAME STN DAYofYEAR YEAR-MM-DD HR:MN:SS.SS ... LATDD LATMN LATSS LONDD LONMN LONSS HGT(m) ...``
names them. Times are GPS time, heights ellipsoidal, the standard deviations SDLAT, SDLON and SDHGT of 95 %.
"""

import re
from datetime import datetime

import numpy as np

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, damaged_lines, unix_s
from vgps.readers.gps_formats.leap_seconds import utc_from_gps
from vgps.readers.gps_formats.rtklib import degrees_of

_HEADER = re.compile(r"^DIR +FRAME .*\bLATDD\b.*$", re.MULTILINE)
_PLACE = ("LATDD", "LATMN", "LATSS", "LONDD", "LONMN", "LONSS", "HGT(m)")
_SIGMAS = ("SDLON(95%)", "SDLAT(95%)", "SDHGT(95%)")
_95_PERCENT = 1.96  # standard deviations of a normal distribution
_OTHER_FRAME = "positions are in {}, which lies 1 to 2 m from WGS 84 in North America"


def looks_like_csrs(data: bytes) -> bool:
    """Whether a line names the columns of CSRS-PPP."""
    return _HEADER.search(data[:20_000].decode("ascii", errors="replace")) is not None


def read_csrs(data: bytes) -> RawLog:
    """Read the positions onto UTC; every fix is of class ``ppp``.

    Where the service lists its forward and its backward solution, the backward one is read, which knows the
    whole log. Damaged lines are skipped and counted.
    """
    text = data.decode("ascii", errors="replace")
    header = _HEADER.search(text)
    columns = header[0].split() if header else []
    lines = enumerate(text.split("\n"), 1)
    rows = [(number, line.split()) for number, line in lines if line.startswith(("FWD ", "BWD "))]
    backward = [row for row in rows if row[1][0] == "BWD"]
    fixes, damaged = [], []
    for number, row in backward or rows:
        try:
            fixes.append(_fix(dict(zip(columns, row, strict=False)), number))
        except (KeyError, ValueError, OverflowError):
            damaged.append(number)
    frames = {row[1] for _, row in rows if len(row) > 1 and row[1].startswith("NAD")}
    doubts = [_OTHER_FRAME.format(frame) for frame in sorted(frames)]
    return RawLog(Clock.UTC, fixes, damaged_lines(damaged), doubts=doubts)


def _fix(row: dict[str, str], number: int) -> Fix:
    clock = next((value for name, value in row.items() if name.startswith("HR:MN:SS")), "")
    gps_s = unix_s(datetime.fromisoformat(f"{row['YEAR-MM-DD']}T{clock}"))
    latitude, longitude, height = degrees_of(np.array([[float(row[name]) for name in _PLACE]]))[0].tolist()
    east, north, up = (float(row.get(name, "nan")) / _95_PERCENT for name in _SIGMAS)
    return Fix(
        t_s=float(utc_from_gps(np.array([gps_s]))[0]),
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        fix_class=FixClass.PPP,
        line=number,
        sigma_m=(east, north, up),
        satellites=float(row.get("NSV", "nan")),
    )

"""Conversion of GPS time to UTC.

GPS time is ahead of UTC by the leap seconds inserted since 1980: IERS Bulletin C,
https://hpiers.obspm.fr/iers/bul/bulc/Leap_Second.dat (TAI - UTC, less the 19 s between TAI and GPS).
"""

from datetime import date

import numpy as np

from vgps.model import FloatArray
from vgps.readers.gps_formats.fixes import unix_day_s

GPS_EPOCH_S = unix_day_s(date(1980, 1, 6))
WEEK_S = 7 * 86400.0
# first days with one more leap second, from 1 s on
_STEPS = """
    1981-07-01 1982-07-01 1983-07-01 1985-07-01 1988-01-01 1990-01-01 1991-01-01 1992-07-01 1993-07-01
    1994-07-01 1996-01-01 1997-07-01 1999-01-01 2006-01-01 2009-01-01 2012-07-01 2015-07-01 2017-01-01
"""
_UTC_S = np.array([unix_day_s(date.fromisoformat(day)) for day in _STEPS.split()])
_GPS_S = _UTC_S + np.arange(1, len(_UTC_S) + 1)


def utc_of_week(week: int, of_week_s: float) -> float:
    """Return UTC [s from 1970] of a GPS week and a time of week [s]."""
    return float(utc_from_gps(np.array([GPS_EPOCH_S + week * WEEK_S + of_week_s]))[0])


def utc_from_gps(gps_s: FloatArray) -> FloatArray:
    """Return UTC of GPS time, both as seconds from 1970 without leap seconds, in the same shape.

    The leap second itself becomes the first second of the next day.
    """
    return gps_s - np.searchsorted(_GPS_S, gps_s, side="right")

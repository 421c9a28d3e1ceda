"""GPS logs as plain CSV with named columns.

One row per fix. Columns may come in any order, unknown ones are ignored; commas, semicolons or tabs separate:

=================  ==========================================================================================
column             meaning (other names)
=================  ==========================================================================================
t_s                seconds since the video's first frame (time_s, video_time_s); or instead of it:
utc                ISO 8601 or Unix time in s, ms, us, ns (timestamp, datetime, time, time_utc, unix_s, %time)
latitude_deg       WGS84 degrees (latitude, lat)
longitude_deg      WGS84 degrees (longitude, lon, lng, long)
height_m           ellipsoidal height (height, ellipsoidal_height_m, hae_m); or:
altitude_m         height above the geoid (altitude, alt, elevation), with geoid_separation_m (undulation_m);
                   without it EGM96's is added. Without any height, or if all are 0, fixes are horizontal
fix_class          rtk_fix, rtk_float, ppp, dgps, sbas, single, or NMEA's quality (class, fix, quality);
                   without it, but with an accuracy, as phones state it, all fixes are single
sigma_east_m       and sigma_north_m, sigma_up_m: the receiver's standard deviations, optional (std_east_m)
accuracy           instead: of both axes together, with vertical_accuracy (horizontal_accuracy, h_acc, v_acc)
hdop, satellites, correction_age_s              optional (num_sats, num_sv; age_s, diff_age_s)
=================  ==========================================================================================

A column named fix_type or status is not used as the class, since receivers number those differently; nor do
accuracies replace it then.
"""

from datetime import datetime
from pathlib import Path

import numpy as np

from vgps.errors import GpsLogError
from vgps.model import FixClass, FloatArray
from vgps.readers.gps_formats.fixes import (
    NMEA_QUALITY,
    Clock,
    Fix,
    RawLog,
    axis_sigmas,
    damaged_lines,
    from_sea_level,
    skipped,
    unix_s,
    with_a_height,
)
from vgps.readers.table import Table, read_table

_VIDEO_TIME = ("t_s", "time_s", "video_time_s")
_UTC_TIME = ("utc", "timestamp", "datetime", "time", "time_utc", "utc_time", "unix_s", "%time")
LATITUDE = ("latitude_deg", "latitude", "lat", "lat_deg", "gps_latitude")
LONGITUDE = ("longitude_deg", "longitude", "lon", "lng", "lon_deg", "long", "gps_longitude")
HEIGHT = ("height_m", "height", "ellipsoidal_height_m", "ellipsoidal_height", "hae_m", "hae")
_ALTITUDE = (
    "altitudeabovemeansealevel",  # where a logger has it, its altitude is above the ellipsoid
    "altitude_m",
    "altitude",
    "alt",
    "alt_m",
    "elevation_m",
    "elevation",
    "ele",
    "altitude_msl_m",
)
_SEPARATION = ("geoid_separation_m", "separation_m", "undulation_m", "geoid_m")
_FIX_CLASS = ("fix_class", "class", "fix", "quality", "fix_quality", "gps_quality")
SATELLITES = ("satellites", "num_sats", "num_sv", "numsv", "sats", "nsat")
_CORRECTION_AGE = ("correction_age_s", "age_s", "diff_age_s", "age")
_ACCURACY = (
    "accuracy",
    "horizontalaccuracy",
    "horizontal_accuracy",
    "h_acc",
    "hacc",
    "horizontal_accuracy_m",
    "h_acc_m",
    "accuracy_m",
)
_VERTICAL = ("verticalaccuracy", "vertical_accuracy", "v_acc", "vacc", "vertical_accuracy_m", "v_acc_m")
_OF_THEIR_OWN = ("fix_type", "fixtype", "status")  # numbers of fix classes that differ between receivers
_ALL_SINGLE = "no fix classes: all count as single; add a column fix_class if the receiver knows better"
_NAMES = {
    **{kind.value: kind for kind in FixClass},
    "fix": FixClass.RTK_FIX,
    "fixed": FixClass.RTK_FIX,
    "rtk_fixed": FixClass.RTK_FIX,
    "float": FixClass.RTK_FLOAT,
    "dgnss": FixClass.DGPS,
    "autonomous": FixClass.SINGLE,
    "gps": FixClass.SINGLE,
    "3d": FixClass.SINGLE,
}
_VALUES = "rtk_fix, rtk_float, dgps or single, or the quality number of NMEA"
_NO_FIX = {"", "0", "none", "no_fix"}


def looks_like_gps_csv(data: bytes) -> bool:
    """Whether the first line that is not a comment names a column of latitudes or longitudes."""
    text = data[:20000].decode("utf-8-sig", errors="replace")
    lines = (line for line in text.splitlines() if line.strip() and not line.startswith("#"))
    header = next(lines, "").lower()
    return any(sep in header for sep in ",;\t") and any(name in header for name in ("lat", "lon", "lng"))


def read_gps_csv(path: Path) -> RawLog:
    """Read a CSV log, see the module's table of columns; rows without a time are skipped.

    Raises:
        GpsLogError: A required column is missing; the message names it and a likely misspelling.
    """
    table = read_table(path, GpsLogError)
    clock, t_s = _times(table)
    latitude = table.numbers(table.require(*LATITUDE), lenient=True)
    longitude = table.numbers(table.require(*LONGITUDE), lenient=True)
    height, above_sea = _heights(table)
    classes, about_classes = _classes(table)
    sigma = _sigmas(table)
    others = [_optional(table, *names) for names in (("hdop",), SATELLITES, _CORRECTION_AGE)]
    bad = ~np.isfinite(t_s)
    numbers = np.column_stack([t_s, latitude, longitude, height, sigma, *others]).tolist()
    fixes = [
        Fix(t, lat, lon, h, kind, line, (east, north, up), *rest)
        for (t, lat, lon, h, east, north, up, *rest), kind, line in zip(
            numbers, classes, table.line.tolist(), strict=True
        )
        if kind is not None and np.isfinite(t)
    ]
    fixes, doubts = with_a_height(fixes)
    fixes, notes = from_sea_level(fixes) if above_sea and not doubts else (fixes, [])
    notes += about_classes
    notes += damaged_lines([*table.short_lines, *table.line[bad].tolist()])
    notes += skipped(classes.count(None), "row", "without a fix")
    return RawLog(clock, fixes, notes, doubts=doubts)


def _times(table: Table) -> tuple[Clock, FloatArray]:
    name = table.find(*_VIDEO_TIME)
    if name is not None:
        return Clock.VIDEO, table.numbers(name, lenient=True)
    name = table.find(*_UTC_TIME)
    if name is None:
        table.require(*_VIDEO_TIME, *_UTC_TIME)
        raise AssertionError
    t_s = np.array([_instant(cell) for cell in table.text(name)])
    # small numbers in a column "time" cannot be Unix times
    recent = np.nanmedian(np.abs(t_s)) > 1e8 if np.isfinite(t_s).any() else True
    return (Clock.UTC if recent else Clock.VIDEO), t_s


def _instant(cell: str) -> float:
    """Return Unix seconds of an ISO 8601 instant or a Unix time, in s, ms, us or ns by its size."""
    try:
        value = float(cell)
    except ValueError:
        try:
            return unix_s(datetime.fromisoformat(cell))
        except ValueError:
            return np.nan
    for limit, scale in ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)):
        if abs(value) > limit:
            return value * scale
    return value


def _heights(table: Table) -> tuple[FloatArray, bool]:
    """Return (N,) heights, NaN without any, and whether they are above the sea without a geoid separation."""
    name = table.find(*HEIGHT)
    if name is not None:
        return table.numbers(name, lenient=True), False
    altitude = table.find(*_ALTITUDE)
    if altitude is None:
        places = {*LATITUDE, *LONGITUDE}  # a latitude reads like an altitude
        if table.like(*HEIGHT, *_ALTITUDE, but=places):
            table.require(*HEIGHT, *_ALTITUDE, but=places)
        return np.full(len(table.line), np.nan), False
    separation = table.find(*_SEPARATION)
    if separation is not None:
        return table.numbers(altitude, lenient=True) + table.numbers(separation, lenient=True), False
    return table.numbers(altitude, lenient=True), True


def _classes(table: Table) -> tuple[list[FixClass | None], list[str]]:
    """Return the classes (N,), None for no fix, and a note if there are only accuracies."""
    classless = not (table.find(*_FIX_CLASS, *_OF_THEIR_OWN) or table.like(*_FIX_CLASS))
    if classless and table.find(*_ACCURACY):
        return [FixClass.SINGLE] * len(table.line), [_ALL_SINGLE]
    return [_fix_class(cell) for cell in table.text(table.require(*_FIX_CLASS, values=_VALUES))], []


def _sigmas(table: Table) -> FloatArray:
    """Return the standard deviations (N, 3) east, north, up, NaN where there are none."""
    of_axes = [_optional(table, f"sigma_{axis}_m", f"std_{axis}_m") for axis in ("east", "north", "up")]
    both, up = _optional(table, *_ACCURACY), _optional(table, *_VERTICAL)
    of_both = [axis_sigmas(*one) for one in zip(both.tolist(), up.tolist(), strict=True)]
    sigma = np.column_stack(of_axes)
    return np.where(np.isnan(sigma), np.array(of_both).reshape(-1, 3), sigma)


def _fix_class(cell: str) -> FixClass | None:
    """Return the class of a fix; None for no fix."""
    name = cell.strip().lower().replace(" ", "_").replace("-", "_")
    if name in _NO_FIX:
        return None
    try:
        number = float(name)
    except ValueError:
        return _NAMES.get(name, FixClass.UNKNOWN)
    return NMEA_QUALITY.get(int(min(number, 99.0)), FixClass.UNKNOWN) if number >= 1 else None


def _optional(table: Table, *names: str) -> FloatArray:
    name = table.find(*names)
    return np.full(len(table.line), np.nan) if name is None else table.numbers(name, lenient=True)

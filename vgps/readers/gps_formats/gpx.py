"""GPX tracks of phones, watches, loggers and receivers' programs, some of which name RTK classes."""

import re
from pathlib import Path

import gpxpy
import numpy as np
from gpxpy.gpx import GPXException, GPXTrackPoint

from vgps.crs import egm96
from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, counted, skipped, unix_s, with_a_height

# <fix> as GPX 1.1 defines it (none, 2d, 3d, dgps, pps), and as programs for RTK receivers write it
_CLASSES = {
    **dict.fromkeys(("2d", "3d", "3", "2", "pps", "gps", "single", "autonomous"), FixClass.SINGLE),
    **dict.fromkeys(("dgps", "dgnss", "differential"), FixClass.DGPS),
    **dict.fromkeys(("sbas", "waas", "egnos"), FixClass.SBAS),
    "ppp": FixClass.PPP,
    **dict.fromkeys(("rtk", "rtk_fix", "rtk_fixed", "fixed", "fix"), FixClass.RTK_FIX),
    **dict.fromkeys(("rtk_float", "frtk", "float"), FixClass.RTK_FLOAT),
}
_NO_FIX = {"none", "no_fix", "0"}
_FIX = re.compile(r"<((?:\w+:)?fix)(?:\s[^>]*)?>\s*([^<]*?)\s*</\1\s*>", re.IGNORECASE)
_POINT = re.compile(r"<(?:\w+:)?(trkpt|rtept|wpt)\b")


def looks_like_gpx(data: bytes) -> bool:
    """Whether the root element is gpx."""
    return re.search(rb"<gpx[\s>]", data[:4096]) is not None


def read_gpx(data: bytes, path: Path) -> RawLog:
    """Read the points of all tracks, in UTC; ``line`` counts the points.

    A point's class is that of its ``<fix>``, including ``rtk`` and ``rtk_float``, which GPX does not define;
    without one it is single. ``ele`` is above the geoid if there is a ``geoidheight``; otherwise it is taken
    as ellipsoidal, with a note. A track without any has horizontal fixes.

    Raises:
        GpsLogError: The file is not GPX, or no point has a time.
    """
    try:
        text = data.decode("utf-8-sig")
        if "<!DOCTYPE" in text:  # GPX has none; with it come entities, which can fill the memory
            raise ValueError("it has a document type")
        classes, text = _classes(text)
        document = gpxpy.parse(text)
    except (GPXException, UnicodeDecodeError, ValueError) as error:
        raise GpsLogError(f"damaged GPX ({error})", file=path, remedy="export the track again") from error
    points = [point for track in document.tracks for segment in track.segments for point in segment.points]
    timed = [(number, point) for number, point in enumerate(points, start=1) if point.time is not None]
    if not timed:
        raise GpsLogError(
            f"{counted(len(points), 'track point')}, none with a time",
            file=path,
            expected="a recorded track (trk with time), not a route or waypoints",
        )
    named = [(number, point, classes.get(number, "3d")) for number, point in timed]
    fixes = [_fix(point, number, name) for number, point, name in named if name not in _NO_FIX]
    lost = [
        *skipped(len(points) - len(named), "point", "without a time"),
        *skipped(len(named) - len(fixes), "point", "without a fix"),
    ]
    fixes, about_none = with_a_height(fixes)
    return RawLog(Clock.UTC, fixes, lost, doubts=about_none or _doubts([point for _, point in timed]))


def _classes(text: str) -> tuple[dict[int, str], str]:
    """Return the ``<fix>`` of each track point, counted from 1, and the text without them.

    gpxpy refuses the whole file for one fix that GPX does not define.
    """
    points = list(_POINT.finditer(text))
    in_track = np.array([point[1] == "trkpt" for point in points], bool)
    starts, numbers = np.array([point.start() for point in points]), np.cumsum(in_track)
    named = list(_FIX.finditer(text))
    # the point that contains each
    last = np.searchsorted(starts, np.array([match.start() for match in named])) - 1
    found = {
        int(numbers[row]): re.sub(r"[\s-]+", "_", match[2].lower())
        for row, match in zip(last.tolist(), named, strict=True)
        if row >= 0 and in_track[row]
    }
    return found, _FIX.sub("", text)


def _fix(point: GPXTrackPoint, number: int, name: str) -> Fix:
    assert point.time is not None
    height = np.nan if point.elevation is None else point.elevation + (point.geoid_height or 0.0)
    return Fix(
        t_s=unix_s(point.time),
        latitude_deg=point.latitude,
        longitude_deg=point.longitude,
        height_m=height,
        fix_class=_CLASSES.get(name, FixClass.UNKNOWN),
        line=number,
        hdop=_number(point.horizontal_dilution),
        satellites=_number(point.satellites),
        correction_age_s=_number(point.age_of_dgps_data),
    )


def _number(value: float | int | None) -> float:
    try:
        return np.nan if value is None else float(value)
    except OverflowError:
        return np.nan


def _doubts(points: list[GPXTrackPoint]) -> list[str]:
    """Return a note on heights that are taken as ellipsoidal though nothing says so."""
    place = [(point.latitude, point.longitude) for point in points if _height_is_vague(point)]
    possible = [(lat, lon) for lat, lon in place if abs(lat) <= 90.0 and abs(lon) <= 360.0]
    if not possible:
        return []
    separation_m = float(egm96().height_m(*np.median(possible, axis=0)))
    off = f"{abs(separation_m):.0f} m too {'low' if separation_m > 0 else 'high'}"
    return [
        "heights without geoidheight are taken as ellipsoidal: if they are above the sea, as most phones and "
        f"watches write them, every pose is {off}"
    ]


def _height_is_vague(point: GPXTrackPoint) -> bool:
    return point.elevation is not None and point.geoid_height is None

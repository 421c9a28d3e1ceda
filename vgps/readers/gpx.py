"""GPX tracks: what phones, watches and loggers write."""

import re
from pathlib import Path

import gpxpy
import numpy as np
from gpxpy.gpx import GPXException, GPXTrackPoint

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.fixes import Clock, Fix, RawLog, unix_s

_CLASSES = {"2d": FixClass.SINGLE, "3d": FixClass.SINGLE, "pps": FixClass.SINGLE, "dgps": FixClass.DGPS}


def looks_like_gpx(data: bytes) -> bool:
    """Whether the document's element is gpx."""
    return re.search(rb"<gpx[\s>]", data[:4096]) is not None


def read_gpx(data: bytes, path: Path) -> RawLog:
    """Points of all tracks, in UTC.

    GPX knows no RTK: a point says dgps or is taken as single. ``ele`` is the height above the geoid where
    ``geoidheight`` stands beside it; else it is taken as ellipsoidal, with a note.

    Raises:
        GpsLogError: The file is no GPX, or no point has a time.
    """
    try:
        document = gpxpy.parse(data.decode("utf-8-sig"))
    except (GPXException, UnicodeDecodeError, ValueError) as error:
        raise GpsLogError(f"damaged GPX ({error})", file=path, remedy="export the track again") from error
    points = [point for track in document.tracks for segment in track.segments for point in segment.points]
    timed = [(number, point) for number, point in enumerate(points, start=1) if point.time is not None]
    if not timed:
        raise GpsLogError(
            f"{len(points)} track points, none with a time",
            file=path,
            expected="a recorded track, no route",
        )
    notes = []
    if len(timed) < len(points):
        notes.append(f"{len(points) - len(timed)} points without a time passed over")
    if any(point.geoid_height is None for _, point in timed):
        notes.append("heights without geoidheight are taken as ellipsoidal: they may be off by 100 m")
    fixes = [_fix(point, number) for number, point in timed if point.type_of_gpx_fix != "none"]
    return RawLog(Clock.UTC, fixes, notes)


def _fix(point: GPXTrackPoint, number: int) -> Fix:
    assert point.time is not None
    height = np.nan if point.elevation is None else point.elevation + (point.geoid_height or 0.0)
    return Fix(
        t_s=unix_s(point.time),
        latitude_deg=point.latitude,
        longitude_deg=point.longitude,
        height_m=height,
        fix_class=_CLASSES.get(point.type_of_gpx_fix or "3d", FixClass.SINGLE),
        line=number,
        hdop=_number(point.horizontal_dilution),
        satellites=_number(point.satellites),
        correction_age_s=_number(point.age_of_dgps_data),
    )


def _number(value: float | int | None) -> float:
    return np.nan if value is None else float(value)

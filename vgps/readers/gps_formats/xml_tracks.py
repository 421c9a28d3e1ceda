"""Tracks with times in XML other than GPX: Garmin's TCX, and KML's gx:Track (Google Earth, OpenTracks)."""

import math
import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import (
    Clock,
    Fix,
    RawLog,
    from_sea_level,
    skipped,
    unix_s,
    with_a_height,
)

_TCX = re.compile(rb"<TrainingCenterDatabase\b")
_KML_TRACK = re.compile(rb"<gx:Track\b")
_Point = tuple[str, str, str, str]  # time, latitude, longitude, altitude as they are written


def looks_like_xml_track(data: bytes) -> bool:
    """Whether it is TCX, or KML with a gx:Track."""
    return _TCX.search(data[:4000]) is not None or _KML_TRACK.search(data) is not None


def read_xml_track(data: bytes, path: Path) -> RawLog:
    """Read the points of a TCX or of KML's gx:Track that have a time and a place; ``line`` counts all points.

    Every fix is single. Altitudes are above the sea; where all are zero, as of tracks on the ground, there
    are none.

    Raises:
        GpsLogError: The XML is damaged.
    """
    try:
        if b"<!DOCTYPE" in data:  # neither has one; with it come entities, which can fill the memory
            raise ValueError("it has a document type")
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise GpsLogError(f"damaged XML ({error})", file=path, remedy="export the track again") from error
    points = list(_tcx(root) if _TCX.search(data[:4000]) else _kml(root))
    found = [_fix(point, number) for number, point in enumerate(points, 1)]
    fixes = [fix for fix in found if fix is not None]
    lost = skipped(len(found) - len(fixes), "point", "without a time and a place")
    if not fixes:
        return RawLog(Clock.UTC, [], lost)
    flat, about_none = with_a_height(fixes)
    raised, about_heights = (flat, []) if about_none else from_sea_level(flat)
    return RawLog(Clock.UTC, raised, [*lost, *about_heights], doubts=about_none)


def _tcx(root: ElementTree.Element) -> Iterator[_Point]:
    for point in root.iter():
        if _name(point) == "Trackpoint":
            text = {_name(part): (part.text or "").strip() for part in point.iter()}
            names = ("Time", "LatitudeDegrees", "LongitudeDegrees", "AltitudeMeters")
            when, latitude, longitude, altitude = (text.get(name, "") for name in names)
            yield when, latitude, longitude, altitude


def _kml(root: ElementTree.Element) -> Iterator[_Point]:
    """Yield the points of each track, which lists times and places separately, in the same order."""
    for track in root.iter():
        if _name(track) == "Track":
            times = [part.text or "" for part in track if _name(part) == "when"]
            places = [(part.text or "").split() for part in track if _name(part) == "coord"]
            for when, place in zip(times, places, strict=False):
                longitude, latitude, altitude = [*place, "", "", ""][:3]
                yield when.strip(), latitude, longitude, altitude


def _name(element: ElementTree.Element) -> str:
    """Return an element's name without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _fix(point: _Point, number: int) -> Fix | None:
    when, latitude, longitude, altitude = point
    try:
        return Fix(
            t_s=unix_s(datetime.fromisoformat(when)),
            latitude_deg=float(latitude),
            longitude_deg=float(longitude),
            height_m=float(altitude or math.nan),
            fix_class=FixClass.SINGLE,
            line=number,
        )
    except (ValueError, OverflowError):
        return None

"""The camera's path as a GPX track."""

from datetime import timedelta
from pathlib import Path

import gpxpy.gpx
import numpy as np

from vgps.solution import Solution
from vgps.writers.maps import geodetic_path

_ELLIPSOIDAL = "Heights (ele) are above the WGS84 ellipsoid, not above the sea."
_ABOVE_SEA = "Heights (ele) are above the geoid, taken to be {:g} m above the WGS84 ellipsoid."
_UNTIMED = " The UTC start of the video is unknown: points have no time."


def write_gpx(solution: Solution, out: Path, geoid_m: float | None = None) -> None:
    """Write a point for every frame, with its time in UTC if the start of the video is known.

    GPX does not define the reference of the height ``ele``; the file's description states it.

    Args:
        solution: A georeferenced run.
        out: The file.
        geoid_m: Height of the geoid above the ellipsoid; ``ele`` is then above the geoid, with a
            ``geoidheight``. Without it ``ele`` is ellipsoidal.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    path, start = geodetic_path(solution), solution.video_start_utc
    described = _ELLIPSOIDAL if geoid_m is None else _ABOVE_SEA.format(geoid_m)
    gpx = gpxpy.gpx.GPX()
    gpx.creator, gpx.name = "vgps", None if solution.recording is None else solution.recording.name
    gpx.description = described + (_UNTIMED if start is None else "")
    segment = gpxpy.gpx.GPXTrackSegment()
    for t_s, (latitude, longitude, height) in zip(solution.t_s.tolist(), path.tolist(), strict=True):
        point = gpxpy.gpx.GPXTrackPoint(
            np.round(latitude, 10),
            np.round(longitude, 10),
            np.round(height - (geoid_m or 0.0), 4),
            None if start is None else start + timedelta(seconds=t_s),
        )
        point.geoid_height = geoid_m
        segment.points.append(point)
    gpx.tracks.append(gpxpy.gpx.GPXTrack(name="camera"))
    gpx.tracks[0].segments.append(segment)
    out.write_text(gpx.to_xml(version="1.1"), encoding="utf-8")

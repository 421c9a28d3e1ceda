"""The camera's path as a GPX track."""

from pathlib import Path

import gpxpy.gpx
import numpy as np

from vgps.writers.export_job import ExportJob

_UNTIMED = " The UTC start of the video is unknown: points have no time."


def write_gpx(job: ExportJob, out: Path) -> None:
    """Write a point for every frame, with its time in UTC if the start of the video is known.

    GPX does not define the reference of the height ``ele``; the file's description states it. Heights above a
    geoid come with its ``geoidheight``.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    solution, utc, geoid = job.solution, job.utc, job.georeferenced.geoid
    gpx = gpxpy.gpx.GPX()
    gpx.creator, gpx.name = "vgps", None if solution.recording is None else solution.recording.name
    gpx.description = f"ele: {job.georeferenced.height_datum}." + (_UNTIMED if utc is None else "")
    segment = gpxpy.gpx.GPXTrackSegment()
    separation = job.geodetic[:, 2] - job.coordinates[:, 2]
    rows = zip(job.geodetic.tolist(), job.coordinates[:, 2].tolist(), separation.tolist(), strict=True)
    for row, ((latitude, longitude, _), height, above) in enumerate(rows):
        point = gpxpy.gpx.GPXTrackPoint(
            np.round(latitude, 10),
            np.round(longitude, 10),
            np.round(height, 4),
            None if utc is None else utc[row],
        )
        point.geoid_height = None if geoid is None else round(above, 4)
        segment.points.append(point)
    gpx.tracks.append(gpxpy.gpx.GPXTrack(name="camera"))
    gpx.tracks[0].segments.append(segment)
    out.write_text(gpx.to_xml(version="1.1"), encoding="utf-8")

"""The camera's path and the fixes for maps: GeoJSON and KML."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import simplekml

from vgps.crs import ELLIPSOIDAL
from vgps.solution import Solution
from vgps.writers.export_job import ExportJob

_COLOURS = {"used": "ff6fb04a", "down-classed": "ff3b9be9", "rejected": "ff3d55c8", "not used": "ff999999"}


def write_geojson(job: ExportJob, out: Path) -> None:
    """Write the camera's path as a line, and every fix as a point with its class and verdict (RFC 7946).

    The standard prescribes WGS 84 and heights above its ellipsoid.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    path, solution = job.geodetic, job.solution
    line = {"type": "LineString", "coordinates": np.round(path[:, [1, 0, 2]], 9).tolist()}
    features = [_feature(line, {"kind": "camera path", "t_s": np.round(solution.t_s, 6).tolist()})]
    for place, properties in _fix_rows(solution):
        features.append(_feature({"type": "Point", "coordinates": place}, properties))
    collection = {"type": "FeatureCollection", "height_datum": ELLIPSOIDAL, "features": features}
    out.write_text(json.dumps(collection, allow_nan=False) + "\n", encoding="utf-8")


def write_kml(job: ExportJob, out: Path) -> None:
    """Write the camera's path as a line, and every fix as a point coloured by its verdict.

    KML's absolute heights are above the geoid (EGM96), those of the run above the ellipsoid: without a geoid
    the path is drawn on the ground.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    kml = simplekml.Kml(name="vgps")
    kml.document.description = f"heights: {job.georeferenced.height_datum}"
    line = kml.newlinestring(name="camera path", coords=job.coordinates.tolist())
    if job.georeferenced.geoid is not None:
        line.altitudemode = simplekml.AltitudeMode.absolute
    line.style.linestyle.color, line.style.linestyle.width = "ff9d8f2a", 3
    folder = kml.newfolder(name="fixes")
    for place, properties in _fix_rows(job.solution):
        point = folder.newpoint(name=str(properties["class"]), coords=[tuple(place)])
        point.description = f"{properties['t_s']} s: {properties['reason']}"
        point.style.iconstyle.color = _COLOURS[properties["verdict"]]
        point.style.iconstyle.scale = 0.5
        point.style.labelstyle.scale = 0.0
    out.write_text(kml.kml(), encoding="utf-8")


def _fix_rows(solution: Solution) -> list[tuple[list[float], dict[str, Any]]]:
    if solution.judged_fixes is None:
        return []
    log, table = solution.judged_fixes
    places = np.round(np.stack([log.longitude_deg, log.latitude_deg, log.height_m], axis=1), 9)
    return [
        (
            place,
            {
                "kind": "fix",
                "t_s": round(float(log.t_s[row]), 6),
                "class": str(log.fix_class[row]),
                "verdict": str(table.verdict[row]),
                "reason": table.reason[row],
            },
        )
        for row, place in enumerate(places.tolist())
        if np.isfinite(place).all()
    ]


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}

"""The camera's path and the fixes for maps: GeoJSON and KML."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import simplekml

from vgps.errors import RunFolderError
from vgps.geodesy import to_geodetic
from vgps.model import FloatArray
from vgps.solution import Solution

_COLOURS = {"used": "ff6fb04a", "down-classed": "ff3b9be9", "rejected": "ff3d55c8", "not used": "ff999999"}


def write_geojson(solution: Solution, out: Path) -> None:
    """Write the camera's path as a line, and every fix as a point with its class and verdict (RFC 7946).

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    path, fixes = geodetic_path(solution), _fix_rows(solution)
    line = {"type": "LineString", "coordinates": np.round(path[:, [1, 0, 2]], 9).tolist()}
    features = [_feature(line, {"kind": "camera path", "t_s": np.round(solution.t_s, 6).tolist()})]
    for place, properties in fixes:
        features.append(_feature({"type": "Point", "coordinates": place}, properties))
    text = json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False)
    out.write_text(text + "\n", encoding="utf-8")


def write_kml(solution: Solution, out: Path, geoid_m: float | None = None) -> None:
    """Write the camera's path as a line, and every fix as a point coloured by its verdict.

    KML's absolute heights are above the geoid, those of the run above the ellipsoid: without ``geoid_m`` the
    path is drawn on the ground.

    Args:
        solution: A georeferenced run.
        out: The file.
        geoid_m: Height of the geoid above the ellipsoid; the path is then drawn at its height.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    path, fixes = geodetic_path(solution), _fix_rows(solution)
    kml = simplekml.Kml(name="vgps")
    path[:, 2] -= geoid_m or 0.0
    line = kml.newlinestring(name="camera path", coords=path[:, [1, 0, 2]].tolist())
    if geoid_m is not None:
        line.altitudemode = simplekml.AltitudeMode.absolute
    line.style.linestyle.color, line.style.linestyle.width = "ff9d8f2a", 3
    folder = kml.newfolder(name="fixes")
    for place, properties in fixes:
        point = folder.newpoint(name=str(properties["class"]), coords=[tuple(place)])
        point.description = f"{properties['t_s']} s: {properties['reason']}"
        point.style.iconstyle.color = _COLOURS[properties["verdict"]]
        point.style.iconstyle.scale = 0.5
        point.style.labelstyle.scale = 0.0
    out.write_text(kml.kml(), encoding="utf-8")


def geodetic_path(solution: Solution) -> FloatArray:
    """Return (F, 3) latitude, longitude [deg], ellipsoidal height [m] of the camera.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    if solution.world_origin is None or not solution.georeferenced:
        raise RunFolderError(
            "the run is not georeferenced",
            expected="a run tied to the world by fixes or control points",
            remedy="export it as tum, kitti, ply, colmap or nerfstudio",
        )
    return to_geodetic(solution.world_origin, solution.world_T_camera[:, :3, 3])


def _fix_rows(solution: Solution) -> list[tuple[list[float], dict[str, Any]]]:
    log, table = solution.gps, solution.fixes
    if log is None or table is None:
        return []
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

"""Landmarks as a PLY point cloud."""

from pathlib import Path

import numpy as np

from vgps.model import GeodeticPoint
from vgps.readers.run_files import SCHEMA_VERSION
from vgps.solution import Landmarks, Observations

PROPERTIES = {
    "x": "double",
    "y": "double",
    "z": "double",
    "red": "uchar",
    "green": "uchar",
    "blue": "uchar",
    "sigma_px": "double",
    "observations": "int",
}
_DTYPES = {"double": "<f8", "uchar": "u1", "int": "<i4"}


def write_ply(
    landmarks: Landmarks,
    observations: Observations,
    world_origin: GeodeticPoint | None,
    out: Path,
    coordinates: str | None = None,
) -> None:
    """Write the landmarks as binary little-endian PLY: ENU metres, grey, reliability, number of observations.

    ``sigma_px`` is sigma_j of Eq. (13), Kume 2010. The ENU origin, if known, is in a comment; or what
    ``coordinates`` says of positions that are in another system.
    """
    count = len(landmarks.world_p_landmark)
    vertices = np.zeros(count, dtype=[(name, _DTYPES[kind]) for name, kind in PROPERTIES.items()])
    for axis, name in enumerate("xyz"):
        vertices[name] = landmarks.world_p_landmark[:, axis]
    for name in ("red", "green", "blue"):
        vertices[name] = landmarks.gray
    vertices["sigma_px"] = landmarks.sigma_px
    vertices["observations"] = np.bincount(observations.landmark, minlength=count)
    out.write_bytes(_header(count, world_origin, coordinates).encode("ascii", "replace") + vertices.tobytes())


def _header(count: int, world_origin: GeodeticPoint | None, coordinates: str | None) -> str:
    lines = ["ply", "format binary_little_endian 1.0", f"comment vgps schema version {SCHEMA_VERSION}"]
    lines.append("comment x east, y north, z up, metres" if coordinates is None else f"comment {coordinates}")
    if world_origin is not None and coordinates is None:
        latitude, longitude, height = (repr(float(value)) for value in world_origin)
        lines.append(f"comment origin latitude {latitude} longitude {longitude} ellipsoidal height {height}")
    lines.append(f"element vertex {count}")
    lines += [f"property {kind} {name}" for name, kind in PROPERTIES.items()]
    return "\n".join([*lines, "end_header", ""])

"""GPS logs in CSV of a receiver with given errors."""

import numpy as np

from vgps.geodesy import to_geodetic
from vgps.model import GeodeticPoint

ORIGIN = GeodeticPoint(35.0, 139.0, 40.0)


def csv_log(path, offsets, classes, t_s=None):
    """Write a log in CSV of a receiver at these offsets (N, 3) from ORIGIN, east, north, up."""
    place = to_geodetic(ORIGIN, np.asarray(offsets, float))
    t_s = np.arange(len(place)) if t_s is None else t_s
    rows = [
        f"{t},{p[0]:.12f},{p[1]:.12f},{p[2]:.6f},{c}" for t, p, c in zip(t_s, place, classes, strict=True)
    ]
    path.write_text("t_s,latitude_deg,longitude_deg,height_m,class\n" + "\n".join(rows) + "\n")
    return path

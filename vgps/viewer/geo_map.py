"""The run on a geographic map: path, fixes and the current position of the camera."""

import numpy as np
import rerun as rr

from vgps.geodesy import to_geodetic
from vgps.model import GeodeticPoint
from vgps.solution import Solution
from vgps.viewer import colours
from vgps.viewer.run_stream import RunStream
from vgps.viewer.scene import fix_groups

MAP = "map"


def log_map(stream: RunStream, solution: Solution, world_origin: GeodeticPoint) -> None:
    """Log latitudes and longitudes of a georeferenced run."""
    path = to_geodetic(world_origin, solution.world_T_camera[:, :3, 3])[:, :2]
    stream.log_static(
        f"{MAP}/path",
        rr.GeoLineStrings(lat_lon=[path], colors=[colours.PATH], radii=rr.Radius.ui_points(2.0)),
    )
    stream.send_frames(f"{MAP}/camera", rr.GeoPoints.columns(positions=path))
    stream.log_static(
        f"{MAP}/camera", rr.GeoPoints.from_fields(colors=[colours.NOW], radii=rr.Radius.ui_points(7.0))
    )
    if solution.fixes is None:
        return
    for fix_class, verdict, rows in fix_groups(solution):
        stream.log_static(
            f"{MAP}/fixes/{fix_class}/{verdict.name.lower()}",
            rr.GeoPoints(
                lat_lon=to_geodetic(world_origin, solution.fixes.world_p_fix[rows])[:, :2],
                colors=np.array([colours.of_fix(fix_class, verdict)] * len(rows), np.uint8),
                radii=rr.Radius.ui_points(4.0),
            ),
        )

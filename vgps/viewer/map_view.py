"""The run on a map: path, fixes, and where the camera is."""

import numpy as np
import rerun as rr

from vgps.geodesy import to_geodetic
from vgps.model import GeodeticPoint
from vgps.solution import Solution
from vgps.viewer import colours
from vgps.viewer.columns import Sheet
from vgps.viewer.scene import fix_groups

MAP = "map"


def log_map(sheet: Sheet, solution: Solution, world_origin: GeodeticPoint) -> None:
    """Log latitudes and longitudes of a run that is tied to the earth."""
    path = to_geodetic(world_origin, solution.world_T_camera[:, :3, 3])[:, :2]
    sheet.static(
        f"{MAP}/path",
        rr.GeoLineStrings(lat_lon=[path], colors=[colours.PATH], radii=rr.Radius.ui_points(2.0)),
    )
    sheet.at_frames(f"{MAP}/camera", rr.GeoPoints.columns(positions=path))
    sheet.static(
        f"{MAP}/camera", rr.GeoPoints.from_fields(colors=[colours.NOW], radii=rr.Radius.ui_points(7.0))
    )
    table = solution.fixes
    if table is not None:
        for fix_class, verdict, rows in fix_groups(solution):
            place = to_geodetic(world_origin, table.world_p_fix[rows])[:, :2]
            sheet.static(
                f"{MAP}/fixes/{fix_class}/{verdict.name.lower()}",
                rr.GeoPoints(
                    lat_lon=place,
                    colors=np.array([colours.of_fix(fix_class, verdict)] * len(rows), np.uint8),
                    radii=rr.Radius.ui_points(4.0),
                ),
            )

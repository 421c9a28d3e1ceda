"""``poses.csv`` and ``gps.csv``: a run as tables. Unknown values are empty."""

from pathlib import Path

import numpy as np

from vgps.geodesy import heading_deg, to_geodetic
from vgps.model import FloatArray, GpsLog
from vgps.solution import FixTable, Solution, Verdict
from vgps.writers.columns import QUATERNION, enu, named, numbers, write_columns
from vgps.writers.tum import quaternion


def write_poses(solution: Solution, out: Path) -> None:
    """Write a row per frame: pose in ENU and geodetic, heading, and standard deviations.

    ``heading_deg`` is that of the optical axis, clockwise from north. The geodetic columns are empty without
    a world origin; the heading is empty if the run is not georeferenced or the camera looks straight up or
    down.
    """
    geodetic = _geodetic(solution)
    columns = {
        "t_s": numbers(solution.t_s, 9),
        "frame": range(len(solution.t_s)),
        "state": map(str, solution.state),
        **enu("{}_m", solution.world_T_camera[:, :3, 3], 6),
        **named(QUATERNION, quaternion(solution.world_T_camera), 12),
        "latitude_deg": numbers(geodetic[:, 0], 10),
        "longitude_deg": numbers(geodetic[:, 1], 10),
        "height_m": numbers(geodetic[:, 2], 6),
        "heading_deg": numbers(_heading(solution), 6),
        **enu("sigma_{}_m", solution.sigma_position_m, 6),
        **enu("sigma_rot_{}_deg", np.degrees(solution.sigma_rotation_rad), 6),
    }
    write_columns(columns, out)


def write_gps(gps: GpsLog | None, fixes: FixTable | None, out: Path) -> None:
    """Write a row per fix: the log's values, the antenna's residual, its ratio to the region, the verdict.

    ``ratio_r`` is the horizontal residual over r, ``ratio_h`` the vertical one over h: the two terms of the
    cylinder, Eq. (16), Kume 2010, before the power. Without a log there is only the header.
    """
    count = 0 if gps is None else len(gps)
    table = fixes if fixes is not None else _no_verdicts(count)
    ratio_r, ratio_h = table.region_ratios
    columns = {
        "line": [] if gps is None else gps.line.tolist(),
        "t_s": [] if gps is None else numbers(gps.t_s, 6),
        "class": [] if gps is None else map(str, gps.fix_class),
        "latitude_deg": [] if gps is None else numbers(gps.latitude_deg, 10),
        "longitude_deg": [] if gps is None else numbers(gps.longitude_deg, 10),
        "height_m": [] if gps is None else numbers(gps.height_m, 6),
        **enu("{}_m", table.world_p_fix, 6),
        **enu("residual_{}_m", table.residual_m, 6),
        "ratio_r": numbers(ratio_r, 6),
        "ratio_h": numbers(ratio_h, 6),
        "r_m": numbers(table.r_m, 6),
        "h_m": numbers(table.h_m, 6),
        "used": ["yes" if used else "no" for used in table.used],
        "verdict": map(str, table.verdict),
        "probability": numbers(table.probability, 6),
        "reason": table.reason,
    }
    write_columns(columns, out)


def _geodetic(solution: Solution) -> FloatArray:
    position = solution.world_T_camera[:, :3, 3]
    if solution.world_origin is None:
        return np.full_like(position, np.nan)
    return to_geodetic(solution.world_origin, position)


def _heading(solution: Solution) -> FloatArray:
    heading = heading_deg(solution.world_T_camera)
    return heading if solution.georeferenced else np.full_like(heading, np.nan)


def _no_verdicts(count: int) -> FixTable:
    unknown = np.full((count, 3), np.nan)
    column = unknown[:, 0]
    return FixTable(
        world_p_fix=unknown,
        residual_m=unknown,
        r_m=column,
        h_m=column,
        probability=column,
        verdict=(Verdict.NOT_USED,) * count,
        reason=("",) * count,
    )

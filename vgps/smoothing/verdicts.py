"""One verdict per fix: where the antenna was against it, whether it took part, and why."""

import numpy as np

from vgps.model import FloatArray, GpsLog
from vgps.smoothing.fixes import Fixes, antenna_at, place
from vgps.solution import FixTable


def fix_table(
    log: GpsLog, fixes: Fixes, t_s: FloatArray, poses: FloatArray, camera_p_antenna: FloatArray, model: str
) -> FixTable:
    """The table behind ``gps.csv``.

    Args:
        log: The fixes as read.
        fixes: The same fixes in the world, with what was used.
        t_s: (F,) frame times, ``poses`` (F, 4, 4): the result.
        camera_p_antenna: (3,) metres.
        model: Name of the GPS model.
    """
    placement = place(t_s, fixes.t_s)
    residual = antenna_at(poses, placement, camera_p_antenna) - fixes.world_p_fix
    residual[~placement.inside] = np.nan
    used = fixes.used & placement.inside & (model != "none")
    reasons = []
    for row in range(len(fixes)):
        if np.isnan(fixes.r_m[row]):
            reasons.append(f"not used: class {log.fix_class[row]} has no region")
        elif not placement.inside[row]:
            reasons.append("not used: outside the video")
        elif model == "none":
            reasons.append("not used: the GPS model is none")
        else:
            reasons.append(_in_words(residual[row], fixes.r_m[row], fixes.h_m[row]))
    return FixTable(fixes.world_p_fix, residual, fixes.r_m, fixes.h_m, used, tuple(reasons))


def _in_words(residual: FloatArray, r_m: float, h_m: float) -> str:
    horizontal, vertical = float(np.hypot(residual[0], residual[1])) / r_m, abs(float(residual[2])) / h_m
    if horizontal <= 1.0 and vertical <= 1.0:
        return "used: the antenna lies in its region"
    return f"used: the antenna lies outside its region, {horizontal:.1f} r and {vertical:.1f} h away"

"""The time offset by whole fits at several of them, where one fit does not know it.

A fit is linear in the time offset, and its losses are robust: while a wrong one is held, the error of an
RTK-float walks along with the path, its steps count less and less as they grow, and the fit stays as unsure
as before. How much worse it becomes is decisive all the same: the profile likelihood.
"""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import TimeOffset
from vgps.model import FloatArray
from vgps.online.fusion.fusion_equations import cost
from vgps.online.fusion.gravity import Gravity
from vgps.online.fusion.live_time_offset import LiveTimeOffset, any_time_offset, believed_time_offset
from vgps.online.fusion.path_fusion import FusedPath, fuse
from vgps.online.fusion.video_path import VideoPath

_VALUES = 9  # of the time offset, within a standard deviation of its prior


def profiled_time_offset(
    path: VideoPath,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    fused: FusedPath,
    config: Config,
    gravity: Gravity | None = None,
) -> TimeOffset | None:
    """Return the rest of the time offset that fits at several of them prefer; None if the given fit knows it
    as well, or if it is likelier that clocks agree.

    Args:
        path, fixes, camera_p_antenna, config, gravity: As in :func:`~vgps.online.fusion.path_fusion.fuse`.
        fused: The fit with what is believed of the time offset.
    """
    prior, believed = any_time_offset(config.sensors), fused.time_offset
    values, step_s = np.linspace(-prior.sigma_s, prior.sigma_s, _VALUES, retstep=True)
    if config.sensors.estimate_time_offset != "auto" or believed.sigma_s < step_s:
        return None
    fixes = fixes.where(fixes.t_s <= path.t_s[-1] - prior.sigma_s)  # the same at all values

    def cost_at(value_s: float) -> float:
        held = LiveTimeOffset(value_s, believed.sigma_s, believed.reach_s)
        found = fuse(path, fixes, camera_p_antenna, config, replace(fused, time_offset=held), gravity)
        return cost(found.nodes, found.state, found.prior)

    try:
        costs = np.array([cost_at(float(value_s)) for value_s in values])
    except np.linalg.LinAlgError:  # the given fit has been found
        return None
    best = int(np.clip(np.argmin(costs), 1, _VALUES - 2))
    before, least, after = costs[best - 1 : best + 2]
    curvature = (before - 2.0 * least + after) / step_s**2
    if curvature <= 0.0:
        return None
    vertex_s = values[best] - (after - before) / (2.0 * step_s) / curvature
    information = float(curvature) + prior.sigma_s**-2.0
    shown = TimeOffset(float(vertex_s * curvature) / information, information**-0.5)
    likely = believed_time_offset(shown, config.sensors)
    if not likely.time_offset_s or abs(likely.time_offset_s - believed.time_offset_s) <= likely.sigma_s:
        return None
    return TimeOffset(shown.time_offset_s, likely.sigma_s)  # its mean is drawn to clocks that agree

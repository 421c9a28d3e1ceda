"""The time offset by whole fits at several of them, where one fit does not know it, or believes a wrong one.

A fit is linear in the time offset, and its losses are robust: while a wrong one is held, the error of an
RTK-float walks along with the path, its steps count less and less as they grow, and the fit stays as unsure
as before. A lever arm that is not known takes the place of a time offset in the same way, and the fit becomes
sure of both. How much worse it becomes is decisive all the same: the profile likelihood.
"""

from dataclasses import replace

import numpy as np

from vgps.config import Config, SensorsConfig
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import TimeOffset
from vgps.online.fusion.fusion_equations import cost
from vgps.online.fusion.gravity import Gravity
from vgps.online.fusion.live_time_offset import LiveTimeOffset, any_time_offset, believed_time_offset
from vgps.online.fusion.path_fusion import FusedPath, fuse
from vgps.online.fusion.video_path import VideoPath

_VALUES = 9  # of the time offset, within a standard deviation of its prior


def unsure_time_offset(believed: TimeOffset, config: SensorsConfig) -> bool:
    """Return whether a fit knows the rest of the time offset no better than fits at several of them would."""
    return believed.sigma_s >= 2.0 * config.time_offset_sigma_s / (_VALUES - 1)


def profiled_time_offset(
    path: VideoPath,
    fixes: Fixes,
    fused: FusedPath,
    config: Config,
    gravity: Gravity | None = None,
) -> TimeOffset | None:
    """Return the rest of the time offset that fits at several of them prefer; None if they prefer that of the
    given fit, or if it is likelier that clocks agree.

    Args:
        path, fixes, config, gravity: As in :func:`~vgps.online.fusion.path_fusion.fuse`.
        fused: The fit with what is believed of the time offset.
    """
    if config.sensors.estimate_time_offset != "auto":
        return None
    prior, believed = any_time_offset(config.sensors), fused.time_offset
    values, step_s = np.linspace(-prior.sigma_s, prior.sigma_s, _VALUES, retstep=True)
    fixes = fixes.where(fixes.t_s <= path.t_s[-1] - prior.sigma_s)  # the same at all values

    def cost_at(value_s: float) -> float:
        held = LiveTimeOffset(value_s, believed.sigma_s, believed.reach_s)
        found = fuse(path, fixes, fused.lever_arm, config, replace(fused, time_offset=held), gravity)
        return cost(found.nodes, found.state, found.prior)

    try:
        costs = np.array([cost_at(float(value_s)) for value_s in values])
        gain = cost_at(believed.time_offset_s) - costs.min()
    except np.linalg.LinAlgError:  # the given fit has been found
        return None
    best = int(np.clip(np.argmin(costs), 1, _VALUES - 2))
    before, least, after = costs[best - 1 : best + 2]
    curvature = (before - 2.0 * least + after) / step_s**2
    if curvature <= 0.0 or gain <= 0.0:
        return None
    vertex_s = values[best] - (after - before) / (2.0 * step_s) / curvature
    # between two minima the cost is no parabola: the better one is as likely as the other one is worse,
    # which is no matter of the spells for which what the fixes prefer counts less
    most = 2.0 * gain * config.sensors.significance_sigmas**2 / (vertex_s - believed.time_offset_s) ** 2
    information = float(min(curvature, most)) + prior.sigma_s**-2.0
    mean_s = float(vertex_s) * (1.0 - prior.sigma_s**-2.0 / information)
    shown = TimeOffset(mean_s, information**-0.5)
    likely = believed_time_offset(shown, config.sensors)
    if not likely.time_offset_s or abs(likely.time_offset_s - believed.time_offset_s) <= likely.sigma_s:
        return None
    return TimeOffset(shown.time_offset_s, likely.sigma_s)  # its mean is drawn to clocks that agree

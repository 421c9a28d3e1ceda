"""The time offset by whole fits at several of them, where one fit does not know it, or believes a wrong one.

A fit is linear in the time offset, and its losses are robust: while a wrong one is held, the error of an
RTK-float walks along with the path, its steps count less and less as they grow, and the fit stays as unsure
as before. A lever arm that is not known takes the place of a time offset in the same way, and the fit becomes
sure of both. A walker's bob, seen ten times a second, makes it sure of a time offset at which its cost is
greatest. How much worse it becomes is decisive all the same: the profile likelihood.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import digamma

from vgps.config import Config, SensorsConfig
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import TimeOffset
from vgps.model import FloatArray
from vgps.online.fusion.fusion_equations import cost, squared_deviations
from vgps.online.fusion.gravity import Gravity
from vgps.online.fusion.live_time_offset import LiveTimeOffset, any_time_offset, believed_time_offset
from vgps.online.fusion.path_fusion import FusedPath, fuse
from vgps.online.fusion.video_path import VideoPath

_VALUES = 9  # of the time offset, within a standard deviation of its prior
_LEAST_REACH_S = 0.5  # also if that is narrow, as another one was found before, which may have been wrong


@dataclass(frozen=True)
class ProfiledClock:
    """What fits at several time offsets say of its rest.

    Attributes:
        shown: The one that they prefer; None if that is what was believed, or if it is likelier that clocks
            agree.
        away_s: How far from what was believed the best one lies, although that may not be beyond doubt.
    """

    shown: TimeOffset | None = None
    away_s: float = 0.0


NOTHING_SHOWN = ProfiledClock()


def unsure_time_offset(believed: TimeOffset, config: SensorsConfig) -> bool:
    """Return whether a fit knows the rest of the time offset no better than fits at several of them would."""
    return believed.sigma_s >= 2.0 * _reach_s(config) / (_VALUES - 1)


def _reach_s(config: SensorsConfig) -> float:
    return max(config.time_offset_sigma_s, _LEAST_REACH_S)


def noisier_than_expected(fused: FusedPath) -> bool:
    """Return whether the fixes differ from the fit by more than their noise would on average.

    That is a Student's t in space; the mean of its negative log-likelihood is a difference of digammas.
    """
    (_, noise), *_ = squared_deviations(fused.nodes, fused.state)
    tail = fused.nodes.fixes.tail
    excess = np.log1p(noise / tail) - digamma(0.5 * (tail + 3.0)) + digamma(0.5 * tail)
    return bool(np.sum((tail + 3.0) * excess) > 0.0)


def profiled_time_offset(
    path: VideoPath,
    fixes: Fixes,
    fused: FusedPath,
    config: Config,
    gravity: Gravity | None = None,
) -> ProfiledClock:
    """Return what fits at several time offsets say of the rest of it; nothing if one of them fails.

    Args:
        path, fixes, config, gravity: As in :func:`~vgps.online.fusion.path_fusion.fuse`.
        fused: The fit with what is believed of the time offset.
    """
    if config.sensors.estimate_time_offset == "no":
        return NOTHING_SHOWN
    prior, believed = any_time_offset(config.sensors), fused.time_offset
    reach_s = _reach_s(config.sensors)
    values = np.linspace(-reach_s, reach_s, _VALUES)
    fixes = fixes.where(fixes.t_s <= path.t_s[-1] - reach_s)  # the same at all values

    def cost_at(value_s: float) -> float:
        held = LiveTimeOffset(value_s, believed.sigma_s, believed.reach_s)
        found = fuse(path, fixes, fused.lever_arm, config, replace(fused, time_offset=held), gravity)
        return cost(found.nodes, found.state, found.prior)

    try:
        costs = np.array([cost_at(float(value_s)) for value_s in values])
        minima = [(at_s, cost_at(at_s), curvature) for at_s, curvature in _minima(values, costs)]
        known = believed.time_offset_s, cost_at(believed.time_offset_s)
    except np.linalg.LinAlgError:  # the given fit has been found
        return NOTHING_SHOWN
    if not minima:
        return NOTHING_SHOWN
    vertex_s, least, curvature = min(minima, key=lambda minimum: minimum[1])
    if known[1] <= least:
        return NOTHING_SHOWN
    away_s = abs(vertex_s - believed.time_offset_s)
    away_s = away_s if away_s > believed.sigma_s else 0.0
    # between two minima the cost is no parabola: the better one is as likely as the other one is worse,
    # which is no matter of the spells for which what the fixes prefer counts less
    apart = [known, *((at_s, other) for at_s, other, _ in minima if at_s != vertex_s)]
    heed = 2.0 * config.sensors.significance_sigmas**2
    most = [heed * (other - least) / (vertex_s - at_s) ** 2 for at_s, other in apart]
    information = min(curvature, *most) + prior.sigma_s**-2.0
    mean_s = vertex_s * (1.0 - prior.sigma_s**-2.0 / information)
    likely = believed_time_offset(TimeOffset(mean_s, information**-0.5), config.sensors)
    if not likely.time_offset_s or abs(likely.time_offset_s - believed.time_offset_s) <= likely.sigma_s:
        return ProfiledClock(away_s=away_s)
    # the likely one's mean is drawn to clocks that agree
    return ProfiledClock(TimeOffset(mean_s, likely.sigma_s), away_s)


def _minima(values: FloatArray, costs: FloatArray) -> Iterator[tuple[float, float]]:
    """Yield each minimum of costs (n,) at evenly spaced values (n,) by a parabola, and the curvature."""
    step_s, padded = values[1] - values[0], np.concatenate([[np.inf], costs, [np.inf]])
    for lowest in np.flatnonzero((costs <= padded[:-2]) & (costs < padded[2:])):
        at = int(np.clip(lowest, 1, len(costs) - 2))
        before, here, after = costs[at - 1 : at + 2]
        curvature = (before - 2.0 * here + after) / step_s**2
        if curvature > 0.0:
            yield float(values[at] - (after - before) / (2.0 * step_s * curvature)), float(curvature)

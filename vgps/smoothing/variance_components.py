"""The balance between video and GPS, estimated from how well the fixes fit: variance components.

Both groups' sigmas cannot be right when the fixes' misfit is not what their regions say. The fixes' sizes
come from a survey, so the video's scale gives way: Förstner's update of a variance component (Förstner 1979,
Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten), ``s^2 <- s^2 * misfit``, with a prior for
the few independent errors that a log holds.
"""

import numpy as np

from vgps.config import BatchConfig, Config
from vgps.gps.fixes import Fixes, antenna_at, place, taking_part
from vgps.model import FloatArray
from vgps.smoothing.covariance import region_sigmas
from vgps.solution import Trajectory


def balanced(
    config: Config,
    scale: float,
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
) -> float:
    """The video's sigma scale for the next round, from the fixes' misfit in this one.

    Args:
        config: What was believed of the scale, and how firmly.
        scale: Of this round.
        path: The result so far.
        fixes: At their times less the lag.
        camera_p_antenna: (3,) metres.
    """
    batch = config.batch
    if batch.balance == "fixed":
        return scale
    share = variance_factor(config, path, fixes, camera_p_antenna)
    return float(np.clip(scale * np.sqrt(share), *_limits(batch)))


def variance_factor(config: Config, path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray) -> float:
    """The fixes' squared misfit over the one expected from their regions, drawn towards 1 where they are few.

    Geodesy's variance factor after an adjustment; covariances are scaled by it as well. Arguments are those
    of :func:`balanced`; it is 1 without fixes.
    """
    taking = fixes.where(taking_part(fixes, path.t_s, config.gps))
    if len(taking) == 0:
        return 1.0
    offset = (
        antenna_at(path.world_T_camera, place(path.t_s, taking.t_s), camera_p_antenna) - taking.world_p_fix
    )
    misfit = np.mean((offset / region_sigmas(taking)) ** 2, axis=1)
    worth, believed = independent_epochs(taking), config.batch.balance_prior_fixes
    return float((believed + worth @ misfit) / (believed + worth.sum()))


def independent_epochs(fixes: Fixes) -> FloatArray:
    """(M,) how much of an independent error each fix brings: its distance from the one before, at most 1."""
    apart = np.diff(fixes.t_s, prepend=-np.inf)
    return np.asarray(np.minimum(apart / fixes.correlation_s, 1.0))


def _limits(batch: BatchConfig) -> tuple[float, float]:
    return batch.video_sigma_scale / batch.balance_range, batch.video_sigma_scale * batch.balance_range

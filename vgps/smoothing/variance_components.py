"""Variance components: the balance between video and GPS, estimated from how well the fixes fit.

If the fixes' misfit is not what their regions predict, the sigmas of video and GPS cannot both be right. The
regions come from a survey, so the video's scale is adapted: Förstner's update of a variance component
(Förstner 1979, Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten), ``s^2 <- s^2 * misfit``,
with a prior for the few independent errors that a log contains.
"""

import numpy as np

from vgps.config import BatchConfig, Config
from vgps.gps.fixes import Fixes, antenna_at, contributing_fixes, place
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
    """Return the video's sigma scale for the next round, from the fixes' misfit in this one.

    Args:
        config: The prior of the scale, and its weight.
        scale: Of this round.
        path: The result so far.
        fixes: In time.
        camera_p_antenna: (3,) metres.
    """
    batch = config.batch
    if batch.balance == "fixed":
        return scale
    share = variance_factor(config, path, fixes, camera_p_antenna)
    return float(np.clip(scale * np.sqrt(share), *_limits(batch)))


def variance_factor(config: Config, path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray) -> float:
    """Return the fixes' squared misfit over that expected from their regions, drawn towards 1 where few.

    Geodesy's variance factor after an adjustment; covariances are scaled by it as well. Arguments are those
    of :func:`balanced`; it is 1 without fixes.
    """
    taking = fixes.where(contributing_fixes(fixes, path.t_s, config.gps))
    if len(taking) == 0:
        return 1.0
    offset = (
        antenna_at(path.world_T_camera, place(path.t_s, taking.t_s), camera_p_antenna) - taking.world_p_fix
    )
    misfit = np.mean((offset / region_sigmas(taking)) ** 2, axis=1)
    worth, believed = independent_epochs(taking), config.batch.balance_prior_fixes
    return float((believed + worth @ misfit) / (believed + worth.sum()))


def independent_epochs(fixes: Fixes) -> FloatArray:
    """Return how independent (M,) each fix's error is of the one before: their time apart, at most 1."""
    apart = np.diff(fixes.t_s, prepend=-np.inf)
    return np.asarray(np.minimum(apart / fixes.correlation_s, 1.0))


def _limits(batch: BatchConfig) -> tuple[float, float]:
    return batch.video_sigma_scale / batch.balance_range, batch.video_sigma_scale * batch.balance_range

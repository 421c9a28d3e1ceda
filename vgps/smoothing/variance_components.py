"""Variance components: the relative weight of video and GPS, estimated from the misfit of the fixes.

If the misfit differs from that expected by the regions, the sigmas of video and GPS cannot both be right. The
regions come from a survey, so the video's scale is adapted: Förstner's update of a variance component
(Förstner 1979, Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten), ``s^2 <- s^2 * misfit``,
with a prior, since a log contains few independent errors.
"""

import numpy as np

from vgps.config import BatchConfig, Config
from vgps.gps.fixes import Fixes, antenna_at, contributing_fixes, place
from vgps.model import FloatArray
from vgps.smoothing.covariance import region_sigmas
from vgps.solution import Trajectory


def balanced_sigma_scale(
    config: Config,
    scale: float,
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
) -> float:
    """Return the video's sigma scale for the next round, from the fixes' misfit in this one.

    Args:
        config: Prior of the scale, and its weight.
        scale: Scale of this round.
        path: Path after this round.
        fixes: Fixes with their verdicts applied and their time offset removed.
        camera_p_antenna: (3,) metres.
    """
    batch = config.batch
    if batch.balance == "fixed":
        return scale
    share = variance_factor(config, path, fixes, camera_p_antenna)
    return float(np.clip(scale * np.sqrt(share), *_limits(batch)))


def variance_factor(config: Config, path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray) -> float:
    """Return the a posteriori variance factor: squared misfit of the fixes over that expected from their
    regions.

    A prior of weight ``balance_prior_fixes`` pulls it towards 1, its value without fixes. Covariances are
    scaled by it as well. Arguments are those of :func:`balanced_sigma_scale`.
    """
    contributing = fixes.where(contributing_fixes(fixes, path.t_s, config.gps))
    if len(contributing) == 0:
        return 1.0
    offset = (
        antenna_at(path.world_T_camera, place(path.t_s, contributing.t_s), camera_p_antenna)
        - contributing.world_p_fix
    )
    misfit = np.mean((offset / region_sigmas(contributing)) ** 2, axis=1)
    weight, prior = independent_epochs(contributing), config.batch.balance_prior_fixes
    return float((prior + weight @ misfit) / (prior + weight.sum()))


def independent_epochs(fixes: Fixes) -> FloatArray:
    """Return the number of independent errors (M,), at most 1, that each fix adds to the one before."""
    interval_s = np.diff(fixes.t_s, prepend=-np.inf)
    return np.asarray(np.minimum(interval_s / fixes.correlation_s, 1.0))


def _limits(batch: BatchConfig) -> tuple[float, float]:
    return batch.video_sigma_scale / batch.balance_range, batch.video_sigma_scale * batch.balance_range

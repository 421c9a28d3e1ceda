"""Variance components: the relative weight of video and GPS, estimated from the misfit of the fixes.

If the misfit differs from that expected by the regions, the sigmas of video and GPS cannot both be right. The
regions come from a survey, so the video's scale is adapted: Förstner's update of a variance component
(Förstner 1979, Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten), ``s^2 <- s^2 * misfit``,
with a prior, since a log contains few independent errors.
"""

import numpy as np

from vgps.config import BatchConfig, Config
from vgps.gps.antenna_path import antenna_offsets
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.fix_factors import contributing_fixes
from vgps.gps.fixes import Fixes, independent_epochs
from vgps.model import FloatArray
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
    contributing = fixes.where(contributing_fixes(fixes, path.t_s, config.gps))
    offset = antenna_offsets(contributing, path, camera_p_antenna)
    share = variance_factor(batch, offset, contributing, independent_epochs(contributing))
    return float(np.clip(scale * np.sqrt(share), *_limits(batch)))


def variance_factor(batch: BatchConfig, offset: FloatArray, fixes: Fixes, weight: FloatArray) -> float:
    """Return the a posteriori variance factor: squared offsets over those expected from the regions.

    A prior of weight ``balance_prior_fixes`` pulls it towards 1, its value without fixes. Covariances are
    scaled by it as well.

    Args:
        batch: Weight of the prior.
        offset: (M, 3) offsets of antennas from fixes, or of a receiver's solutions, metres.
        fixes: Fixes with the regions of these offsets.
        weight: (M,) number of independent errors that each offset counts as.
    """
    if len(fixes) == 0:
        return 1.0
    misfit, prior = np.mean((offset / region_sigmas(fixes)) ** 2, axis=1), batch.balance_prior_fixes
    return float((prior + weight @ misfit) / (prior + weight.sum()))


def _limits(batch: BatchConfig) -> tuple[float, float]:
    return batch.video_sigma_scale / batch.balance_range, batch.video_sigma_scale * batch.balance_range

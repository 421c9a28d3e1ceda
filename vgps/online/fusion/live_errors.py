"""Noise, walk and size of the errors of fix classes, learned while the video runs.

How far an error walks differs between receivers more than anything else about them; taken for a bad one, a
good receiver does not hold the path. A fit gives the steps of the offsets and the noise about them. Their
scales follow from MacKay's fixed point (Bayesian Interpolation, Neural Computation 4, 1992): squared
deviations over the number of them that the data determine, with the classes as priors. Each fit begins with
what the one before it shows.

The size of the offsets follows in the same way, from stretches whose offsets video and other fixes determine.
It says how far the path may lie from the next such fixes.

RTK-fixes keep the constants of their class, since every path follows them; so do noise and walk of classes
whose errors drift steadily for longer, which steps from fix to fix do not show. How long a rate lasts is that
of the mean receiver. RTK-fixes that were down-classed count as floats, but show nothing of the receiver's
floats.
"""

from collections.abc import Mapping

import numpy as np

from vgps.config import GpsConfig
from vgps.gps.fixes import CLASSES
from vgps.gps.learned_errors import LearnedErrors
from vgps.gps.offset_errors import averaged_over_receivers, between_receivers
from vgps.model import FixClass, FloatArray
from vgps.online.fusion.block_system import BlockSystem
from vgps.online.fusion.fusion_equations import OFFSET, POSITION, FusionState, squared_deviations
from vgps.online.fusion.fusion_nodes import FusionNodes

_STEADY_S = 10.0  # time for which errors keep their rate of change, from which on they are not learned
_NEWTON_STEPS = 20
_ANTENNA_AND_OFFSET = np.r_[POSITION, OFFSET]
_SUM = np.hstack([np.eye(3), np.eye(3)])  # of both, which is where a fix lies but for its noise


def errors_in_fit(
    nodes: FusionNodes, state: FusionState, system: BlockSystem, config: GpsConfig, used: GpsConfig
) -> dict[FixClass, LearnedErrors]:
    """Return noise and walk of the classes that may be learned, as a fit shows them.

    Args:
        nodes, state, system: The fit.
        config: Priors of the classes.
        used: Noise and walk in the fit.
    """
    fixes, learned = nodes.fixes, {}
    # the first fix of each node: what the others walked since is in their noise
    first = np.flatnonzero((np.diff(fixes.node, prepend=-1) > 0) & ~fixes.down_classed)
    node, fix_class = fixes.node[first], fixes.fix_class[first]
    walks = np.isfinite(nodes.walk_tail[node]) & (node > 0)
    (_, noise), (_, walk), _ = squared_deviations(nodes, state)
    at_fix = system.covariances()[node][:, _ANTENNA_AND_OFFSET]
    covariance = _SUM @ at_fix[:, :, _ANTENNA_AND_OFFSET] @ _SUM.T
    noise_shown = _shown(noise[first], covariance, fixes.noise_m[first], fixes.tail[first])
    step, at = node[walks] - 1, node[walks]
    covariance = system.change_covariances()[step, OFFSET, OFFSET]
    walk_shown = _shown(walk[step], covariance, nodes.walk_m[at], nodes.walk_tail[at])
    for k in np.unique(fix_class).tolist():
        name = CLASSES[k]
        prior, now = config.offset_errors(name), averaged_over_receivers(used.offset_errors(name))
        if name is FixClass.RTK_FIX or prior.rate_lasts_s > _STEADY_S:
            continue
        noise_k, walk_k = noise_shown[:, fix_class == k], walk_shown[:, fix_class[walks] == k]
        learned[name] = LearnedErrors(
            noise_m=_mean_scale(prior.noise_m, prior.noise_spread, now.noise_m, noise_k),
            walk_m=_mean_scale(prior.walk_m, prior.walk_spread, now.walk_m, walk_k),
            rate_lasts_s=now.rate_lasts_s,
        )
    return learned


def sizes_in_fit(
    nodes: FusionNodes,
    state: FusionState,
    system: BlockSystem,
    config: GpsConfig,
    used: Mapping[FixClass, float],
) -> dict[FixClass, float]:
    """Return the offsets of the classes but RTK-fix over those of the median receiver, as a fit shows them.

    A stretch counts as one offset, and again for every correlation time that it lasts. One that follows
    RTK-fixes does not count at once: a receiver that loses its ambiguities goes on from where it was.

    Args:
        nodes, state, system: The fit.
        config: Priors of the classes.
        used: Sizes in the fit; of other classes the root mean square over receivers.
    """
    node, first = np.unique(nodes.fixes.node, return_index=True)
    fix_class, size_m = nodes.fixes.fix_class[first], nodes.size_m[node]
    share = (nodes.bound[node, 0] * size_m[:, 0]) ** 2
    after_fix = np.append(False, fix_class[:-1] == CLASSES.index(FixClass.RTK_FIX))
    share[(nodes.starts[node] & after_fix) | nodes.fixes.down_classed[first]] = 0.0
    squared = np.sum((state.values[node, OFFSET] / size_m) ** 2, axis=1)
    variance = np.diagonal(system.covariances()[node, OFFSET, OFFSET], axis1=1, axis2=2)
    shown = share * [squared, np.maximum(3.0 - np.sum(variance / size_m**2, axis=1), 0.0)]
    sizes = {}
    for k in np.unique(fix_class[~nodes.fixes.down_classed[first]]).tolist():
        name, prior = CLASSES[k], config.offset_errors(CLASSES[k])
        if name is not FixClass.RTK_FIX:
            now = used.get(name, between_receivers(prior))
            log, of_log = _log_scale(prior.between_receivers, now, shown[:, fix_class == k])
            # the root mean square, half the way to it: whole steps may overshoot, each fit the other way
            sizes[name] = float(np.sqrt(now * np.exp(log + of_log)))
    return sizes


def _shown(squared: FloatArray, covariance: FloatArray, scale_m: FloatArray, tail: FloatArray) -> FloatArray:
    """Return reweighted squared deviations, and how many components the data determine, (2, n).

    Args:
        squared: (n,) deviations in their scales, squared.
        covariance: (n, 3, 3) of the deviations, square metres.
        scale_m: (n, 3) scales of Student's t.
        tail: (n,) its degrees of freedom.
    """
    weight = (tail + 3.0) / (tail + squared)
    unknown = weight * np.sum(np.diagonal(covariance, axis1=1, axis2=2) / scale_m**2, axis=1)
    return np.stack([weight * squared, np.maximum(3.0 - unknown, 0.0)])


def _mean_scale(median_m: float, spread: float, now_m: float, shown: FloatArray) -> float:
    """Return the mean of a scale with this median under its posterior, taken as log-normal."""
    log, variance = _log_scale(spread, now_m / median_m, shown)
    return float(median_m * np.exp(log + variance / 2.0))


def _log_scale(spread: float, now: float, shown: FloatArray) -> tuple[float, float]:
    """Return the log of a scale over its median, and the variance of the log, under the posterior.

    The log-likelihood of log scale x about the median is ``-squared exp(-2 x) / 2 - determined x``.

    Args:
        spread: Of the log-normal prior.
        now: The scale in the fit, over the median.
        shown: (2, n) what the fit shows, in that scale.
    """
    if spread == 0.0:
        return 0.0, 0.0
    squared, determined = shown.sum(axis=1) * [now**2, 1.0]
    x = 0.0
    for _ in range(_NEWTON_STEPS):
        fit = squared * np.exp(-2.0 * x)
        x -= float(np.clip((determined - fit + x / spread**2) / (2.0 * fit + spread**-2.0), -1.0, 1.0))
    return x, float(1.0 / (2.0 * squared * np.exp(-2.0 * x) + spread**-2.0))

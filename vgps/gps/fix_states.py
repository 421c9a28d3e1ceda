"""A hidden Markov model of the receiver's errors.

The error of a fix is that of its class, or that of the class below (a wrong integer ambiguity leaves an
RTK-fix with the error of an RTK-float), or it is an outlier of up to tens of metres. An error may persist:
a wrong ambiguity or a reflection gives the next fixes the same error. So six fixes that agree with each other
but with no other fix are more likely one error than six. Under the error model with memory the error of a
class persists, too, up to the walk of its offset: a stretch of fixes counts once, however many they are.

What persists is a matter of time: a receiver that measures ten times a second repeats a wrong position ten
times as often, which makes it no likelier.
"""

from math import gamma

import numpy as np

from vgps.config import Config, OutlierConfig
from vgps.gps.fixes import Fixes, seconds_after
from vgps.gps.offset_errors import log_walk_density
from vgps.model import BoolArray, FloatArray

NOMINAL, LOWER, OUTLIER, REPEATED_NOMINAL, REPEATED_LOWER, REPEATED_OUTLIER = range(6)
_REPEATED = {
    NOMINAL: REPEATED_NOMINAL,
    REPEATED_NOMINAL: REPEATED_NOMINAL,
    LOWER: REPEATED_LOWER,
    REPEATED_LOWER: REPEATED_LOWER,
    OUTLIER: REPEATED_OUTLIER,
    REPEATED_OUTLIER: REPEATED_OUTLIER,
}


def state_probabilities(
    offset: FloatArray, fixes: Fixes, config: Config, tolerance_m: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return the probabilities of each fix's states given all fixes, by the forward-backward algorithm.

    The density inside a class is that of the cylinder, ``exp(-omega Psi) / Z``, Eq. (11)(16), Kume 2010. A
    survey drops its worst epochs, so a small share of a class has a larger cylinder. Outliers are uniform
    within ``outlier_radius_m`` of the antenna. A repeated error equals that of a second before up to the
    regions of the two; between fixes of one stretch that follow sooner it walks within these, as that of
    their class does.

    Args:
        offset: (M, 3) antenna minus fix, metres.
        fixes: In order of time, each with a region.
        config: Priors, and the exponent and weight of the cylinder.
        tolerance_m: Error of the path itself.

    Returns:
        (M, 6), columns NOMINAL, LOWER, OUTLIER, REPEATED_NOMINAL, REPEATED_LOWER, REPEATED_OUTLIER, and the
        logs (M,) of the density of each offset given those before it.
    """
    log_density = _log_densities(offset, fixes, config, tolerance_m)
    highest = log_density.max(axis=1)
    density = np.exp(log_density - highest[:, None])
    prior = _prior(fixes, config)
    change = _transitions(prior, fixes, config)
    forward, size = np.empty_like(density), np.empty(len(density))
    belief = prior[0]
    for k, likelihood in enumerate(density):
        belief = (belief if k == 0 else belief @ change[k - 1]) * likelihood
        size[k] = belief.sum()
        belief = forward[k] = belief / size[k]
    # a state that the fixes before exclude would overflow where those after it all suggest it
    possible = forward > np.finfo(np.float64).tiny
    backward = possible.astype(np.float64)
    for k in range(len(density) - 2, -1, -1):
        after = change[k] @ (density[k + 1] * backward[k + 1])
        np.divide(after, size[k + 1], out=backward[k], where=possible[k])
    return forward * backward, np.log(size) + highest


def _prior(fixes: Fixes, config: Config) -> FloatArray:
    """Return the prior (M, 6) of each fix's states, independent of the previous fix."""
    lower = np.where(np.isfinite(fixes.lower_r_m), config.outliers.lower_share, 0.0)
    bad = np.full(len(fixes), config.outliers.outlier_share)
    none = np.zeros(len(fixes))
    return np.stack([1.0 - lower - bad, lower, bad, none, none, none], axis=1)


def _transitions(prior: FloatArray, fixes: Fixes, config: Config) -> FloatArray:
    """Return the transition probabilities (M - 1, 6, 6) from each fix to the next."""
    change = np.repeat(prior[1:, None, :], prior.shape[1], axis=1)
    lasts, anew = config.outliers.persistence ** seconds_after(fixes)[1:], drawn_anew(fixes, config)
    for state in (NOMINAL, REPEATED_NOMINAL):  # goes wrong as often in a second, however many fixes that has
        change[:, state, LOWER:] *= anew[:, None]
        change[:, state, NOMINAL] = 1.0 - change[:, state, LOWER:].sum(axis=1)
    jumps = 1.0 - config.gps.memory.persistence
    share = {
        REPEATED_NOMINAL: np.where(_continued(fixes, config), 1.0 - jumps * anew, 0.0),
        # a fix whose class has none below it cannot be in that state
        REPEATED_LOWER: np.where(prior[1:, LOWER] > 0.0, lasts, 0.0),
        REPEATED_OUTLIER: lasts,
    }
    for state, repeated in _REPEATED.items():
        moved = share[repeated]
        if repeated == REPEATED_NOMINAL:
            moved = moved * change[:, state, NOMINAL]
            change[:, state, NOMINAL] -= moved
        else:
            change[:, state] *= (1.0 - moved)[..., None]
        change[:, state, repeated] += moved
    return change


def drawn_anew(fixes: Fixes, config: Config) -> FloatArray:
    """Return the share (M - 1,) of an error that is drawn anew from each fix to the next.

    All of it after a second, or where a fix does not continue the stretch of the one before.
    """
    return np.where(_continued(fixes, config), seconds_after(fixes)[1:], 1.0)


def _continued(fixes: Fixes, config: Config) -> BoolArray:
    """Return whether each fix (M - 1,) continues the stretch of the one before, under errors with memory."""
    if not config.gps.has_memory:
        return np.zeros(max(len(fixes) - 1, 0), dtype=bool)
    same = np.diff(fixes.fix_class) == 0
    return np.asarray(same & (np.diff(fixes.t_s) <= config.gps.memory.max_gap_s))


def _log_densities(offset: FloatArray, fixes: Fixes, config: Config, tolerance_m: float) -> FloatArray:
    """Return the log density (M, 6) of the offset [1/m^3] in each state."""
    nominal = _log_class_density(offset, fixes.r_m, fixes.h_m, config, tolerance_m)
    with np.errstate(invalid="ignore"):  # NaN where there is no class below
        lower = _log_class_density(offset, fixes.lower_r_m, fixes.lower_h_m, config, tolerance_m)
    lower = np.where(np.isnan(lower), -np.inf, lower)
    bad = np.full(len(offset), log_outlier_density(config.outliers))
    step = np.diff(offset, axis=0)
    walked = log_walk_density(step, fixes, config.gps, tolerance_m)
    repeated = np.append(-np.inf, _log_repeated_density(step, walked, fixes, config, tolerance_m))
    walked = np.append(-np.inf, walked)
    # a jump within a stretch leads to another offset of the class
    farther = np.append(0.0, np.minimum(np.diff(nominal), 0.0))
    return np.stack([nominal, lower, bad, walked + farther, repeated, repeated], axis=1)


def log_outlier_density(config: OutlierConfig) -> float:
    """Return the log density of an outlier, anywhere within ``outlier_radius_m`` [1/m^3]."""
    return float(-np.log(2.0 * np.pi * config.outlier_radius_m**3))


def _log_repeated_density(
    step: FloatArray, walked: FloatArray, fixes: Fixes, config: Config, tolerance_m: float
) -> FloatArray:
    """Return the log density (M - 1,) [1/m^3] of the steps (M - 1, 3) of a wrong error that lasts.

    ``walked`` (M - 1,) is that of the same steps of an error of the class.
    """
    r, h = np.hypot(fixes.r_m[1:], fixes.r_m[:-1]), np.hypot(fixes.h_m[1:], fixes.h_m[:-1])
    same, most = (_log_class_density(each, r, h, config, tolerance_m) for each in (step, np.zeros_like(step)))
    within = walked + same - most  # heavy tails would lead beyond the regions
    anew = drawn_anew(fixes, config)
    with np.errstate(divide="ignore"):  # log 0 of what is excluded
        return np.asarray(np.logaddexp(same + np.log(anew), within + np.log1p(-anew)))


def _log_class_density(
    offset: FloatArray, r_m: FloatArray, h_m: FloatArray, config: Config, tolerance_m: float
) -> FloatArray:
    settings = config.outliers
    core = _log_density(offset, r_m, h_m, config, tolerance_m)
    tail = _log_density(offset, settings.tail_size * r_m, settings.tail_size * h_m, config, tolerance_m)
    both = np.logaddexp(core + np.log(1.0 - settings.tail_share), tail + np.log(settings.tail_share))
    return np.asarray(both)


def _log_density(
    offset: FloatArray, r_m: FloatArray, h_m: FloatArray, config: Config, tolerance_m: float
) -> FloatArray:
    """Return the log (M,) of the cylinder's density [1/m^3]; NaN without a region."""
    n, omega = config.gps.n, config.gps.omega
    r, h = np.hypot(r_m, tolerance_m), np.hypot(h_m, tolerance_m)
    horizontal, vertical = np.hypot(offset[:, 0], offset[:, 1]) / r, np.abs(offset[:, 2]) / h
    with np.errstate(over="ignore"):
        psi = horizontal ** (2 * n) + vertical ** (2 * n)
    # the integral of exp(-omega Psi) over space
    area = np.pi * r**2 * gamma(1.0 + 1.0 / n) * omega ** (-1.0 / n)
    length = 2.0 * h * gamma(1.0 + 0.5 / n) * omega ** (-0.5 / n)
    return np.asarray(-omega * psi - np.log(area * length))

"""Estimation of the time offset between GPS and video from changes of speed and heading.

The error of a fix changes slowly, over a minute for an RTK-float, so the displacement between successive
fixes is far more accurate than their positions. Compared with the camera's displacement over the same time it
makes the time offset observable wherever speed or heading changes, but not on a straight at constant speed.
Scale and heading of visual odometry are wrong by a slowly changing factor, which would look like a time
offset while a vehicle keeps accelerating or turning. So the displacements are compared at the best such
factor for every time offset.
"""

from dataclasses import replace

import numpy as np
from scipy.special import ndtr, ndtri, stdtr, stdtrit

from vgps.config import Config, SensorsConfig
from vgps.gps.fixes import Fixes, one_per_interval
from vgps.gps.jackknife import MIN_PAIRS, jackknife_sigma, without_blocks
from vgps.gps.neighbour_pairs import NeighbourPairs, neighbour_pairs
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.solution import Trajectory

_ITERATIONS = 30  # upper limit; from the best value of the grid a few suffice
_NO_INFORMATION = 1e-6  # per square second
_SPACING_S = 1.0  # of fixes that are compared: receivers filter their positions
_MIN_SPACINGS = 20  # in a log: those of a short one are shorter


def estimate_time_offset(
    sensors: Sensors, path: Trajectory, fixes: Fixes, config: Config
) -> tuple[Sensors, tuple[str, ...]]:
    """Return the sensors with the time offset that a path without fixes shows, and warnings.

    Where none is certain, one that is likelier than none counts. If errors have memory, stage D says whether
    the poses show more; errors without let them.

    Args:
        sensors: Lever arm, and the time offset to replace.
        path: In the world, at approximately the right scale, and not bent to the fixes.
        fixes: Fixes at the times of their time stamps.
        config: All settings.
    """
    found, warnings = update_time_offset(sensors, path, fixes, config.sensors)
    if found.prior_time_offset.sigma_s or not config.gps.has_memory:
        return found, warnings
    if config.sensors.estimate_time_offset == "auto" and not warnings:
        return likelier_time_offset(found, path, fixes, config.sensors)
    return found, ()


def update_time_offset(
    sensors: Sensors, path: Trajectory, fixes: Fixes, config: SensorsConfig
) -> tuple[Sensors, tuple[str, ...]]:
    """Decide whether the time offset is estimated with the poses, and set its prior; also return warnings.

    Args:
        sensors: Lever arm, and the time offset to update.
        path: The path so far.
        fixes: Fixes at the times of their time stamps, with their verdicts applied.
        config: Prior of the time offset, and limits of significance.
    """
    prior = TimeOffset.from_config(config)
    if not prior.sigma_s:
        return sensors, ()
    compared = spaced(fixes, spacing_s(fixes))
    pairs = neighbour_pairs(path, compared, sensors.camera_p_antenna, prior, config.time_offset)
    best = best_time_offset(pairs, prior)
    if _is_shown(best, pairs, prior, config):
        best = _over_parts(best, pairs, path, compared, sensors, config)
    if _is_shown(best, pairs, prior, config):
        # the path was fitted before at another time offset, which may hide part of it: a wider prior
        sigma_s = float(np.hypot(best.sigma_s, config.trusted_time_offset_s))
        return sensors.with_time_offset(TimeOffset(best.time_offset_s, sigma_s)), (
            f"the GPS positions are {best.time_offset_s:.2f} s older than their time stamps; the fixes were "
            "shifted accordingly",
        )
    held = replace(sensors.with_time_offset(TimeOffset(config.time_offset_s, 0.0)), by_displacements=best)
    if _is_observable(best, prior, config) or not fixes.used.any():
        return held, ()
    return held, (
        "the motion does not determine the time offset between video and GPS (standard deviation "
        f"{best.sigma_s:.2f} s); it was held at {config.time_offset_s:g} s: record turns or braking to "
        "estimate it",
    )


def likelier_time_offset(
    sensors: Sensors, path: Trajectory, fixes: Fixes, config: SensorsConfig
) -> tuple[Sensors, tuple[str, ...]]:
    """Shift fixes by a time offset that is likelier than none, though it might be chance.

    Two hypotheses, equally likely before, are weighed by their evidence (Kass & Raftery, Bayes Factors,
    1995): clocks that agree to ``trusted_time_offset_s``, and any time offset of the prior. The standard
    deviation covers both.

    Coarse fixes are shifted by less than they err anyway. What may be chance must not spoil RTK-fixes: with
    the probability of the time offset the poses decide.

    Args:
        sensors, path, fixes, config: As for :func:`update_time_offset`, which held the time offset.
    """
    prior, found = TimeOffset.from_config(config), _shown(sensors, path, fixes, config)
    if found is None:
        return sensors, ()
    likely, probability = model_average(found, prior, config.trusted_time_offset_s)
    shift_m = path.length_m / float(np.ptp(path.t_s)) * abs(likely.time_offset_s - prior.time_offset_s)
    clear = likely.sigma_s <= config.time_offset.shown_share * prior.sigma_s
    if not (probability >= 0.5 and clear):
        return sensors, ()
    if shift_m > fixes.r_m[fixes.used].min():
        return sensors.with_time_offset(likely, probability), ()
    late = f"{likely.time_offset_s:.2f} s (standard deviation {likely.sigma_s:.2f} s)"
    return sensors.with_time_offset(likely), (
        f"the GPS positions are {late} older than their time stamps with a probability of {probability:.0%}; "
        "the fixes were shifted accordingly",
    )


def spacing_s(fixes: Fixes) -> float:
    """Return the seconds between the fixes that are compared."""
    duration_s = float(np.ptp(fixes.t_s)) if len(fixes) else 0.0
    return min(_SPACING_S, duration_s / _MIN_SPACINGS) or _SPACING_S


def spaced(fixes: Fixes, interval_s: float) -> Fixes:
    """Return the first fix of each interval: errors of closer ones are alike, and would count too much."""
    return fixes.where(one_per_interval(fixes.t_s, interval_s, 0.5))  # the stamps of 1 Hz in the middle


def compared_fixes(fixes: Fixes) -> Fixes:
    """Return the used fixes, so far apart that each counts."""
    used = fixes.where(fixes.used)
    return spaced(used, spacing_s(used))


def model_average(found: TimeOffset, prior: TimeOffset, trusted_s: float) -> tuple[TimeOffset, float]:
    """Return the mean over both hypotheses with its standard deviation, and the probability of an offset.

    Args:
        found: What the fixes say, without the prior.
        prior: Any time offset.
        trusted_s: Standard deviation of the other hypothesis about the prior's mean.
    """
    variance, change = found.sigma_s**2, found.time_offset_s - prior.time_offset_s
    of_hypothesis = np.array([trusted_s, prior.sigma_s]) ** 2
    total = of_hypothesis + variance
    evidence = np.exp(-0.5 * (change**2 / total - change**2 / total.max())) / np.sqrt(total)
    share = evidence / evidence.sum()
    mean, spread = change * of_hypothesis / total, of_hypothesis * variance / total
    weighed_mean = float(share @ mean)
    sigma_s = float(np.sqrt(share @ (spread + (mean - weighed_mean) ** 2)))
    return TimeOffset(prior.time_offset_s + weighed_mean, sigma_s), float(share[1])


def without_prior(found: TimeOffset, prior: TimeOffset) -> TimeOffset:
    """Return what the fixes alone say of a time offset that was found under a prior."""
    information = max(found.sigma_s**-2 - prior.sigma_s**-2, _NO_INFORMATION)
    change = (found.time_offset_s - prior.time_offset_s) * found.sigma_s**-2 / information
    return TimeOffset(prior.time_offset_s + change, information**-0.5)


def with_prior(shown: TimeOffset, prior: TimeOffset) -> TimeOffset:
    """Return a time offset that fixes alone show under a prior, the reverse of :func:`without_prior`."""
    share = prior.sigma_s**2 / (prior.sigma_s**2 + shown.sigma_s**2)
    moved_s = share * (shown.time_offset_s - prior.time_offset_s)
    return TimeOffset(prior.time_offset_s + moved_s, float(np.sqrt(share)) * shown.sigma_s)


def agreed_time_offset(config: SensorsConfig) -> TimeOffset:
    """Return the prior of clocks that agree, but not exactly."""
    sigma_s = float(np.hypot(config.trusted_time_offset_s, config.frame_time_sigma_s))
    return TimeOffset(config.time_offset_s, sigma_s)


def agree_exactly(shown: TimeOffset, config: SensorsConfig) -> bool:
    """Return whether that makes clocks that agree exactly likelier, as likely before as those that do not."""
    _, differ = model_average(shown, agreed_time_offset(config), 0.0)
    return differ < 0.5


def with_agreed_clock(sensors: Sensors, path: Trajectory, fixes: Fixes, config: SensorsConfig) -> Sensors:
    """Return sensors with the time offset of clocks that agree but for some hundredths of a second.

    Clocks that agree do so exactly, as where a receiver triggers the camera, or to a standard deviation: by
    exposure, transport and rounded time stamps. Both are as likely before, unless all frame times err. Poses
    that were held to a wrong time offset have bent to the fixes and show but a part of it, so that they begin
    at what displacements say.

    Args:
        sensors, path, fixes, config: As for :func:`update_time_offset`, of a time offset that is not certain.
    """
    prior = agreed_time_offset(config)
    if sensors.prior_time_offset.sigma_s and sensors.probability == 1.0:
        return sensors
    shown = _shown(sensors, path, fixes, config)
    if not config.frame_time_sigma_s and (shown is None or agree_exactly(shown, config)):
        return sensors
    agreed = prior if shown is None else with_prior(shown, prior)
    placed = sensors if sensors.prior_time_offset.sigma_s else sensors.with_time_offset(agreed)
    return replace(placed, agreed=agreed)


def _shown(sensors: Sensors, path: Trajectory, fixes: Fixes, config: SensorsConfig) -> TimeOffset | None:
    """Return what fixes alone say of the time offset; None if none is likelier than that of the prior."""
    prior = TimeOffset.from_config(config)
    pairs = neighbour_pairs(
        path, spaced(fixes, _SPACING_S), sensors.camera_p_antenna, prior, config.time_offset
    )
    found = without_prior(best_time_offset(pairs, prior), prior)
    gain = pairs.gain(found.time_offset_s, prior.time_offset_s)
    if gain <= 0.0 or pairs.degrees_of_freedom < 1:
        return None
    # a sigma from few pairs is itself uncertain: what the fixes prefer counts, by Student's t
    sigmas = -float(ndtri(stdtr(pairs.degrees_of_freedom, -np.sqrt(gain))))
    sigma_s = max(found.sigma_s, abs(found.time_offset_s - prior.time_offset_s) / sigmas)
    return replace(found, sigma_s=sigma_s)


def _is_observable(best: TimeOffset, prior: TimeOffset, config: SensorsConfig) -> bool:
    """Return whether displacements know a time offset better than its prior."""
    return best.sigma_s < config.time_offset.shown_share * prior.sigma_s


def _is_shown(best: TimeOffset, pairs: NeighbourPairs, prior: TimeOffset, config: SensorsConfig) -> bool:
    """Return whether displacements show a time offset; one that is to be estimated anyway if they know it.

    The best value of a grid may be precise by chance: it must explain the fixes better than the prior.
    """
    if not _is_observable(best, prior, config) or config.estimate_time_offset == "yes":
        return _is_observable(best, prior, config)
    change_s = abs(best.time_offset_s - prior.time_offset_s)
    chance_s = config.significance_sigmas * float(np.hypot(config.trusted_time_offset_s, best.sigma_s))
    tried = 1.0 + 2.0 * config.time_offset.search_sigmas * prior.sigma_s / best.sigma_s
    needed = min_gain(config.significance_sigmas, pairs.degrees_of_freedom, tried)
    return change_s > chance_s and pairs.gain(best.time_offset_s, prior.time_offset_s) > needed


def _over_parts(
    best: TimeOffset,
    pairs: NeighbourPairs,
    path: Trajectory,
    fixes: Fixes,
    sensors: Sensors,
    config: SensorsConfig,
) -> TimeOffset:
    """Return a time offset with a standard deviation no less than a jackknife's over parts of the video.

    On a bend the drift of the video's heading looks like a time offset for longer than from one pair to the
    next.
    """
    if pairs.count < MIN_PAIRS:
        return best
    prior, settings = TimeOffset.from_config(config), config.time_offset
    parts = without_blocks(fixes, int(np.ptp(path.t_s) / settings.knot_s))
    others = (neighbour_pairs(path, part, sensors.camera_p_antenna, prior, settings) for part in parts)
    jackknife_s = jackknife_sigma([best_time_offset(other, prior).time_offset_s for other in others])
    under_prior_s = jackknife_s / float(np.hypot(1.0, jackknife_s / prior.sigma_s))
    return replace(best, sigma_s=max(best.sigma_s, under_prior_s))


def min_gain(significance_sigmas: float, degrees_of_freedom: int, values: float) -> float:
    """Return the gain in log-likelihood, times two, above which the best of many values is significant.

    Student's t, since the spread is estimated from few pairs, with Bonferroni's correction for the number of
    values.

    Args:
        significance_sigmas: Significance as standard deviations of a single value of known spread.
        degrees_of_freedom: Degrees of freedom of the residuals that give the spread.
        values: Number of distinguishable values.
    """
    if degrees_of_freedom < 1:
        return float("inf")
    chance = float(ndtr(-significance_sigmas)) / values
    return float(stdtrit(degrees_of_freedom, chance)) ** 2


def best_time_offset(pairs: NeighbourPairs, prior: TimeOffset) -> TimeOffset:
    """Return the time offset at which the displacements of the fixes agree best with the camera's.

    Minimises a Cauchy loss of the differences relative to their spread, plus the prior, from the best value
    of a grid.
    """
    if pairs.count < 3:
        return prior
    reach, step_s = pairs.config.search_sigmas * prior.sigma_s, pairs.config.search_step_s
    grid = prior.time_offset_s + np.arange(-reach, reach + step_s, step_s)
    time_offset_s = float(grid[int(np.argmin(np.median(pairs.difference(grid), axis=-1)))])
    for _ in range(_ITERATIONS):
        step, sigma_s = pairs.step(time_offset_s, prior)
        time_offset_s += step
        if abs(step) < 1e-5:
            break
    return TimeOffset(time_offset_s, sigma_s)

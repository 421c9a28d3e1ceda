"""Distribution of the noise about offsets and of their steps: Student's t, with heavy tails."""

from dataclasses import dataclass, fields

import numpy as np
from scipy.special import gammaln, stdtrit

from factors import Gaussian
from vgps.config import GpsConfig
from vgps.config.gps import OffsetErrors
from vgps.gps.fixes import CLASSES, Fixes
from vgps.model import FixClass, FloatArray

_MANY = 8  # steps that show how large most are
_THREE_QUARTERS = 0.75  # cumulative probability of the median of what a distribution is off its middle
_ONE_SIGMA = 0.8413  # cumulative probability of one standard deviation of a Gaussian


def errors_of(fixes: Fixes, config: GpsConfig) -> list[OffsetErrors]:
    """Return the errors of each fix's class."""
    by_class = {k: config.offset_errors(CLASSES[k]) for k in np.unique(fixes.fix_class).tolist()}
    return [by_class[k] for k in fixes.fix_class.tolist()]


def between_receivers(errors: OffsetErrors) -> float:
    """Return the root mean square over receivers, whose scales are log-normal, over the median."""
    return float(np.exp(errors.between_receivers**2))


def averaged_over_receivers(errors: OffsetErrors) -> OffsetErrors:
    """Return the errors averaged over receivers, whose scales are log-normal: noise, walk and its rate."""
    means = {
        "noise_m": errors.noise_m * float(np.exp(errors.noise_spread**2 / 2.0)),
        "walk_m": errors.walk_m * float(np.exp(errors.walk_spread**2 / 2.0)),
        "rate_lasts_s": errors.rate_lasts_s * float(np.exp(errors.rate_spread**2 / 2.0)),
    }
    return errors.model_copy(update=means)


@dataclass(frozen=True, kw_only=True)
class FixErrors:
    """Noise and walk (M,) of fixes, as in :class:`vgps.config.gps.OffsetErrors`."""

    noise_m: FloatArray
    walk_m: FloatArray
    rate_lasts_s: FloatArray
    tail: FloatArray
    vertical: FloatArray


def mean_errors(fixes: Fixes, config: GpsConfig) -> FixErrors:
    """Return noise and walk of fixes, averaged over receivers."""
    kinds, which = np.unique(fixes.fix_class, return_inverse=True)
    means = [averaged_over_receivers(config.offset_errors(CLASSES[k])) for k in kinds.tolist()]
    columns = {one.name: np.array([getattr(mean, one.name) for mean in means]) for one in fields(FixErrors)}
    return FixErrors(**{name: column[which] for name, column in columns.items()})


def one_sigma(errors: OffsetErrors) -> float:
    """Return the standard deviation of noise and steps over their scale.

    That of a Gaussian with the same 68 % limits as Student's t, whose variance may be infinite.
    """
    return float(stdtrit(errors.tail, _ONE_SIGMA))


def student(errors: OffsetErrors, horizontal_m: float, logging_sigma_m: FloatArray | float = 0.0) -> Gaussian:
    """Return the loss of Student's t in space, as Cauchy's loss: ``k^2 = tail + 3`` and a smaller sigma.

    Args:
        errors: Degrees of freedom, and the ratio of the vertical scale to the horizontal one.
        horizontal_m: Scale on each horizontal axis.
        logging_sigma_m: (3,) standard deviations of what logging added to the errors.
    """
    scale_m = np.hypot(horizontal_m * np.array([1.0, 1.0, errors.vertical]), logging_sigma_m)
    east, north, up = (scale_m * np.sqrt(errors.tail / (errors.tail + 3.0))).tolist()
    return Gaussian((east, north, up), float(np.sqrt(errors.tail + 3.0)))


def walk_scale(errors: OffsetErrors | FixErrors, interval_s: FloatArray) -> FloatArray:
    """Return the scales of steps over intervals (...), metres.

    Sums of n independent steps are n^(1/a) times as long, a = 2 if their variance is finite, else the tail's
    degrees of freedom (the stable laws; Feller, An Introduction to Probability Theory, vol. 2, 1971).
    """
    return np.asarray(errors.walk_m * interval_s ** (1.0 / np.minimum(errors.tail, 2.0)))


def step_scale(errors: OffsetErrors | FixErrors, interval_s: FloatArray) -> FloatArray:
    """Return the scales (...) [m] of independent steps that lead as far as a rate of change that lasts."""
    return np.asarray(walk_scale(errors, interval_s) * np.sqrt(errors.rate_lasts_s))


def log_walk_density(
    step: FloatArray, fixes: Fixes, config: GpsConfig, tolerance_m: float = 0.0
) -> FloatArray:
    """Return the log density (M - 1,) [1/m^3] of steps between fixes of one stretch, Student's t in space.

    Steps of RTK-fixes are at least as large as most in the log are, as those of an antenna that sways beside
    the camera: they do not tell that a fix is wrong.

    Args:
        step: (M - 1, 3) change of the error from each fix to the next, metres.
        fixes: In order of time.
        config: Errors of the classes.
        tolerance_m: Error of the path that gives the steps.
    """
    errors, interval_s = errors_of(fixes, config)[1:], np.diff(fixes.t_s)
    walk = np.array([walk_scale(one, dt) for one, dt in zip(errors, interval_s, strict=True)])
    noise, tail, vertical = (
        np.array([getattr(one, name) for one in errors]) for name in ("noise_m", "tail", "vertical")
    )
    plane = np.sqrt(walk**2 + 2.0 * noise**2)
    scale = np.hypot(np.stack([plane, plane, vertical * plane], axis=1), tolerance_m)
    scale = np.hypot(scale, np.hypot(fixes.logging_sigma_m[:-1], fixes.logging_sigma_m[1:]))
    fixed = fixes.fix_class == CLASSES.index(FixClass.RTK_FIX)
    within = fixed[1:] & fixed[:-1] & (interval_s <= config.memory.max_gap_s)
    if within.sum() >= _MANY:
        median_m = np.median(np.abs(step[within]), axis=0)
        scale[within] = np.maximum(scale[within], median_m / stdtrit(tail[within, None], _THREE_QUARTERS))
    norm = gammaln((tail + 3.0) / 2.0) - gammaln(tail / 2.0) - 1.5 * np.log(tail * np.pi)
    squared = np.sum((step / scale) ** 2, axis=1)
    return np.asarray(norm - np.log(scale).sum(axis=1) - (tail + 3.0) / 2.0 * np.log1p(squared / tail))

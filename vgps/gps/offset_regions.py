"""Regions of offsets: what classes and stated sigmas say about their size, and how sure both are of it."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import digamma, gammaincinv, polygamma

from vgps.config import GpsConfig
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.offset_errors import errors_of
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FloatArray

_INSIDE = 0.95  # share of the errors that a region holds
_LIGHT_TAIL = 4.0  # degrees of freedom beyond which Student's t has a kurtosis


def with_offset_regions(fixes: Fixes, config: GpsConfig) -> Fixes:
    """Return fixes with the regions of their offsets, those of the median receiver."""
    log_size, _ = _log_sizes(fixes, config)
    r_m, h_m = np.exp(log_size).T
    return replace(fixes, r_m=r_m, h_m=h_m)


def with_mean_offset_regions(fixes: Fixes, config: GpsConfig) -> Fixes:
    """Return fixes with the regions of their offsets in the root mean square over receivers.

    An offset that lasts as long as the log shows nothing of its size, so that the receiver may be any.
    """
    log_size, variance = _log_sizes(fixes, config)
    r_m, h_m = np.exp(log_size + variance).T
    return replace(fixes, r_m=r_m, h_m=h_m)


class OffsetBounds(NamedTuple):
    """Bounds (M,) of offsets: fixes with the regions of the penalty (16), and the tails of Student's t.

    A tail is infinite where the bound has none; see :func:`factors.offset_factor`.
    """

    fixes: Fixes
    tail: FloatArray


def offset_bounds(fixes: Fixes, config: GpsConfig, n: int) -> OffsetBounds:
    """Return the bounds of offsets of receivers whose size is log-normal.

    Densities of different sizes mix to one with heavy tails, as Student's t, whose log of the size has the
    variance ``trigamma(tail / 2) / 4``. So an offset well inside the region of its class is held closely, as
    that of a good receiver, and one far outside loosely. Of the median receiver the region holds 95 % of what
    the penalty (16), Kume 2010, allows, with ``n = 1`` a Gaussian.

    Where the size is known so well that the tails would have a kurtosis, the bound is that of the mean
    receiver without tails: what lies far outside then is no fix of its class, but a wrong one, which has
    verdicts of its own.
    """
    log_size, variance = _log_sizes(fixes, config)
    half = np.array([_half_tail(value) for value in variance[:, 0].tolist()])  # by what is known in the plane
    heavy = 2.0 * half <= _LIGHT_TAIL
    of_mixture = 0.5 * (digamma(half) - np.log(half))  # log of the scale of Student's t over the median size
    scale = np.exp(np.where(heavy[:, None], of_mixture[:, None], variance))
    plane, line = ((2.0 * gammaincinv(axes / (2.0 * n), _INSIDE)) ** (0.5 / n) for axes in (2, 1))
    r_m, h_m = (np.exp(log_size) * scale).T
    tail = np.where(heavy, 2.0 * half, np.inf)
    return OffsetBounds(replace(fixes, r_m=r_m / plane, h_m=h_m / line), tail)


@cache
def _half_tail(variance: float) -> float:
    """Return half the degrees of freedom of the mixture whose log of the size has this variance."""
    return float(brentq(lambda half: float(polygamma(1, half)) - 4.0 * variance, 1e-3, 1.0 + 1.0 / variance))


def _log_sizes(fixes: Fixes, config: GpsConfig) -> tuple[FloatArray, FloatArray]:
    """Return the logs (M, 2) of radius and half height, and the variances (M, 2) of these logs.

    Class and stated sigma are log-normal estimates of the size: the result is their weighted mean.
    """
    memory, classes = config.memory, [CLASSES[k] for k in fixes.fix_class.tolist()]
    regions, errors = [config.regions[name] for name in classes], errors_of(fixes, config)
    # what enlarges the region of a fix enlarges that of its offset
    r_m = fixes.r_m * np.array([own.r_m / one.r_m for own, one in zip(errors, regions, strict=True)])
    h_m = fixes.h_m * np.array([own.h_m / one.h_m for own, one in zip(errors, regions, strict=True)])
    along = np.hypot(fixes.sigma_m[:, 0], fixes.sigma_m[:, 1]) / np.sqrt(2.0)
    of_class = np.log(np.stack([r_m, h_m], axis=1))
    stated_m = np.stack([INSIDE_PLANE * along, INSIDE_LINE * fixes.sigma_m[:, 2]], axis=1)
    between = np.array([own.between_receivers**2 for own in errors])[:, None]
    with np.errstate(divide="ignore"):
        stated = np.log(memory.stated_factor * stated_m)
    known = np.isfinite(stated)
    share = np.where(known, between / (between + memory.stated_spread**2), 0.0)
    log_size = (1.0 - share) * of_class + share * np.where(known, stated, 0.0)
    return log_size, (1.0 - share) * between

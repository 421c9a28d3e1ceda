"""Regions of offsets: what classes and stated sigmas say about their size, and how sure both are of it."""

from dataclasses import replace

import numpy as np
from scipy.special import gammaincinv

from vgps.config import GpsConfig
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.offset_errors import errors_of
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FloatArray

_INSIDE = 0.95  # share of the errors that a region holds


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


def with_offset_bounds(fixes: Fixes, config: GpsConfig, n: int) -> Fixes:
    """Return fixes with the bounds of their offsets, at which these cost as much as a one-sigma residual.

    The penalty (16), Kume 2010, is then that of the density of which the region of the mean receiver holds
    95 %: with ``n = 1`` a Gaussian. A class whose size differs little between receivers is bounded closely.
    """
    mean = with_mean_offset_regions(fixes, config)
    plane, line = ((2.0 * gammaincinv(axes / (2.0 * n), _INSIDE)) ** (0.5 / n) for axes in (2, 1))
    return replace(mean, r_m=mean.r_m / plane, h_m=mean.h_m / line)


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

"""The region of every fix: that of its class, enlarged where the log says that the fix is worse than its
class.

A survey is made in good conditions, and r(p) and h(p) hold there (future work of Kume 2010: accuracy from
more than the fix class). Nothing makes a region smaller: receivers are too confident.
"""

from collections.abc import Sequence

import numpy as np

from vgps.config import GpsConfig, QualityConfig
from vgps.model import FixClass, FloatArray, GpsLog

INSIDE_PLANE, INSIDE_LINE = float(np.sqrt(-2.0 * np.log(0.05))), 1.96
"""Sigmas within which 95 % of Gaussian errors lie, in a plane and along a line."""
UNKNOWNS = 4  # position and clock: with so many satellites none is left to check the others


def region_sizes(fix_class: tuple[FixClass, ...], config: GpsConfig) -> tuple[FloatArray, FloatArray]:
    """Return radius (M,) and half height (M,) of every fix by its class, NaN for a class without a region."""
    regions = config.regions
    r_m = np.array([regions[name].r_m if name in regions else np.nan for name in fix_class])
    h_m = np.array([regions[name].h_m if name in regions else np.nan for name in fix_class])
    return r_m, h_m


def lower_class(fix_class: FixClass) -> FixClass:
    """Return the class whose error a fix may have instead of its own; UNKNOWN if there is none.

    A wrong integer ambiguity leaves an RTK-fix with the error of an RTK-float.
    """
    return FixClass.RTK_FLOAT if fix_class is FixClass.RTK_FIX else FixClass.UNKNOWN


def ellipsoid_shapes(fix_class: Sequence[FixClass], config: GpsConfig) -> FloatArray:
    """Return (M, 2) semi-axes alpha, beta of (22) over r, h of every fix by its class; 1 without a region."""
    regions = config.regions
    shapes = [regions[name].ellipsoid_shape if name in regions else (1.0, 1.0) for name in fix_class]
    return np.array(shapes).reshape(-1, 2)


def enlarged(
    r_m: FloatArray, h_m: FloatArray, log: GpsLog, config: QualityConfig
) -> tuple[FloatArray, FloatArray]:
    """Return radius (M,) and half height (M,) of the log's fixes, enlarged by DOP, satellites, age and
    sigmas.

    In this order: times :func:`geometry_factor`; plus the error of corrections that are no longer fresh; and
    at least the region of 95 % of the errors of the receiver's own sigmas.
    """
    if not config.enlarge:
        return r_m, h_m
    factor = geometry_factor(log.hdop, log.satellites, config)
    stale = config.age_rate_m_s * np.fmax(np.nan_to_num(log.correction_age_s) - config.fresh_s, 0.0)
    r_m, h_m = factor * r_m + stale, factor * h_m + stale
    along = np.hypot(log.sigma_m[:, 0], log.sigma_m[:, 1]) / np.sqrt(2.0)
    known = np.isfinite(r_m)
    wider, higher = np.fmax(r_m, INSIDE_PLANE * along), np.fmax(h_m, INSIDE_LINE * log.sigma_m[:, 2])
    return np.where(known, wider, r_m), np.where(known, higher, h_m)


def geometry_factor(hdop: FloatArray, satellites: FloatArray, config: QualityConfig) -> FloatArray:
    """Return how much worse (M,) the geometry of the satellites is than in a survey, at least 1.

    An error grows with the dilution of precision; where the log has none, with the root of the satellites
    that are left over to check the others.
    """
    by_dilution = hdop / config.good_hdop
    left = np.maximum(satellites - UNKNOWNS, 1.0)  # unknown stays unknown
    by_count = np.sqrt((config.good_satellites - UNKNOWNS) / left)
    return np.fmax(np.where(np.isfinite(hdop), by_dilution, by_count), 1.0)

"""The region of every fix: that of its class, enlarged where the log reports worse conditions.

A survey is made in good conditions, and r(p) and h(p) hold there (future work of Kume 2010: accuracy from
more than the fix class). Regions are never reduced, because receivers are overconfident.
"""

from collections.abc import Sequence

import numpy as np

from vgps.config import GpsConfig, QualityConfig
from vgps.model import FixClass, FloatArray, GpsLog

INSIDE_PLANE, INSIDE_LINE = float(np.sqrt(-2.0 * np.log(0.05))), 1.96
"""Sigmas within which 95 % of Gaussian errors lie, in a plane and along a line."""
UNKNOWNS = 4  # position and clock; only satellites beyond these are redundant


def region_sizes(fix_class: tuple[FixClass, ...], config: GpsConfig) -> tuple[FloatArray, FloatArray]:
    """Return radius (M,) and half height (M,) of the class of every fix; NaN for a class without a region."""
    regions = config.regions
    r_m = np.array([regions[name].r_m if name in regions else np.nan for name in fix_class])
    h_m = np.array([regions[name].h_m if name in regions else np.nan for name in fix_class])
    return r_m, h_m


def lower_class(fix_class: FixClass) -> FixClass:
    """Return the class below, whose error a fix may have; UNKNOWN if there is none.

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
    """Return radius (M,) and half height (M,) enlarged by DOP, satellites, age of corrections and sigmas.

    In this order: multiplied by :func:`geometry_factor`; plus the error of old corrections; at least the
    region of 95 % of the errors by the receiver's sigmas; and with what logging added to the errors.
    """
    if not config.enlarge:
        return r_m, h_m
    factor = geometry_factor(log.hdop, log.satellites, config)
    stale = config.age_rate_m_s * np.fmax(np.nan_to_num(log.correction_age_s) - config.fresh_s, 0.0)
    r_m, h_m = factor * r_m + stale, factor * h_m + stale
    along = np.hypot(log.sigma_m[:, 0], log.sigma_m[:, 1]) / np.sqrt(2.0)
    known = np.isfinite(r_m)
    wider, higher = np.fmax(r_m, INSIDE_PLANE * along), np.fmax(h_m, INSIDE_LINE * log.sigma_m[:, 2])
    r_m, h_m = np.where(known, wider, r_m), np.where(known, higher, h_m)
    east_m, north_m, up_m = log.logging_sigma.T
    plane_m = np.hypot(east_m, north_m) / np.sqrt(2.0)
    return np.hypot(r_m, INSIDE_PLANE * plane_m), np.hypot(h_m, INSIDE_LINE * up_m)


def geometry_factor(hdop: FloatArray, satellites: FloatArray, config: QualityConfig) -> FloatArray:
    """Return the factor (M,), at least 1, by which the satellites' geometry is worse than in a survey.

    The error is proportional to the dilution of precision; where the log has none, to the inverse root of the
    number of redundant satellites.
    """
    by_dilution = hdop / config.good_hdop
    redundant = np.maximum(satellites - UNKNOWNS, 1.0)  # NaN stays NaN
    by_count = np.sqrt((config.good_satellites - UNKNOWNS) / redundant)
    return np.fmax(np.where(np.isfinite(hdop), by_dilution, by_count), 1.0)

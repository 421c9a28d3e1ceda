"""GTSAM factors of fixes: the penalty of each on the antenna's offset, by the configured model."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import Cylinder, Ellipsoid, Gaussian, Penalty, gps_factor_calibrating, gps_factor_interpolated
from vgps.config import GpsConfig
from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors
from vgps.model import BoolArray, FloatArray

_CAUCHY_K = 2.385  # 95 % efficiency on Gaussian errors


def penalty(fixes: Fixes, row: int, config: GpsConfig, n: int | None = None) -> Penalty:
    """Return the penalty on an offset from fix ``row`` under the configured model.

    Args:
        fixes: All fixes.
        row: Row of the fix.
        config: Selects the model: (14), (15), (16), (22) of Kume 2010 or Cauchy on (15).
        n: Exponent, if not the configured one.
    """
    r_m, h_m = float(fixes.r_m[row]), float(fixes.h_m[row])
    exponent = n or config.n
    if config.model == "cylinder":
        return Cylinder(r_m, h_m, exponent, config.omega)
    if config.model == "ellipsoid":
        alpha, beta = fixes.shape[row].tolist()
        return Ellipsoid(alpha * r_m, beta * h_m, exponent, config.omega)
    if config.model == "gaussian":
        return Gaussian((config.gaussian_sigma_m,) * 3)
    # without the receiver's sigmas, half the region of the class
    stated = np.isfinite(fixes.sigma_m[row])
    sigma = np.where(stated, fixes.sigma_m[row], np.array([r_m, r_m, h_m]) / 2.0)
    sigma = np.maximum(sigma, config.min_sigma_m)
    en, eu, nu = fixes.correlation[row].tolist() if stated.all() else (0.0, 0.0, 0.0)
    k = _CAUCHY_K if config.model == "cauchy" else None
    return Gaussian((float(sigma[0]), float(sigma[1]), float(sigma[2])), k, (en, eu, nu))


def contributing_fixes(fixes: Fixes, frame_t_s: FloatArray, config: GpsConfig) -> BoolArray:
    """Return which fixes (M,) get a factor: used ones within the frames, none for the model ``none``."""
    if config.model == "none" or len(frame_t_s) < 2:
        return np.zeros(len(fixes), dtype=bool)
    return np.asarray(fixes.used & place(frame_t_s, fixes.t_s).inside)


def gps_graph(
    fixes: Fixes,
    frame_t_s: FloatArray,
    sensors: Sensors,
    config: GpsConfig,
    n: int | None = None,
    antenna_velocity: FloatArray | None = None,
) -> gtsam.NonlinearFactorGraph:
    """Return the GPS term of the energy (11) over frames with keys ``x0..``, one factor per contributing fix.

    Args:
        fixes: Fixes with the time offset removed; :func:`contributing_fixes` selects among them.
        frame_t_s: (F,) times of the frames.
        sensors: Lever arm, and whether it and the time offset are estimated with the poses.
        config: GPS model; ``none`` gives an empty graph.
        n: Exponent, if not the configured one.
        antenna_velocity: (M, 3) m/s at the fixes; needed if time offset or lever arm are estimated.
    """
    graph = gtsam.NonlinearFactorGraph()
    contributing = contributing_fixes(fixes, frame_t_s, config)
    if not contributing.any():
        return graph
    placement = place(frame_t_s, fixes.t_s)
    for row in np.flatnonzero(contributing).tolist():
        a, b = int(placement.frame[row]), int(placement.frame[row]) + 1
        alpha, fix, cost = float(placement.alpha[row]), fixes.world_p_fix[row], penalty(fixes, row, config, n)
        if sensors.is_estimated:
            assert antenna_velocity is not None
            keys = (X(a), X(b)), (TIME_OFFSET, ANTENNA)
            factor = gps_factor_calibrating(*keys, alpha, fix, antenna_velocity[row], cost)
        else:
            factor = gps_factor_interpolated((X(a), X(b)), alpha, fix, sensors.camera_p_antenna, cost)
        graph.push_back(factor)
    return graph

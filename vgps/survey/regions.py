"""Cylinder, ellipsoid and correlation time of the errors of one fix class."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from vgps.model import FixClass, FloatArray
from vgps.survey.memory import Memory

_RATIOS = np.geomspace(0.02, 50.0, 400)  # vertical over horizontal semi-axis, before refinement
_LOG_RATIO_TOLERANCE = 1e-8  # of the refined ratio: the least volume may be at a kink


@dataclass(frozen=True)
class Ellipsoid:
    """Semi-axes of an ellipsoid of revolution about the vertical, alpha and beta of Eq. (22), Kume 2010."""

    alpha_m: float
    beta_m: float


@dataclass(frozen=True, kw_only=True)
class ClassSurvey:
    """The survey of one fix class.

    Attributes:
        fix_class: The class.
        epochs: Fixes of that class.
        r_m, h_m: Radius r(p) and half height h(p) of its cylinder, without the worst share, with motion.
        largest_m: Largest horizontal and vertical error of all epochs.
        ellipsoid: Of least volume, dropping as many epochs as the cylinder does.
        correlation_s: Integral of the error's autocorrelation.
        independent: Number of independent epochs with the same information.
        memory: How the error changes from fix to fix; None if no two fixes follow each other.
        changes: Number of pairs of fixes that follow each other.
    """

    fix_class: FixClass
    epochs: int
    r_m: float
    h_m: float
    largest_m: tuple[float, float]
    ellipsoid: Ellipsoid
    correlation_s: float
    independent: float
    memory: Memory | None
    changes: int


def region(errors_m: FloatArray, drop: float) -> tuple[float, float]:
    """Return the largest horizontal and vertical error after dropping the worst share of each.

    Table 4, Kume 2010.

    Args:
        errors_m: (N, 3) east, north, up, N >= 1.
        drop: Share to drop of each, 0 <= drop < 1.
    """
    horizontal = np.sort(np.hypot(errors_m[:, 0], errors_m[:, 1]))
    vertical = np.sort(np.abs(errors_m[:, 2]))
    kept = len(errors_m) - int(drop * len(errors_m))
    return float(horizontal[kept - 1]), float(vertical[kept - 1])


def outside(errors_m: FloatArray, r_m: float, h_m: float) -> int:
    """Return the number of errors (N, 3) outside a cylinder."""
    beyond = np.hypot(errors_m[:, 0], errors_m[:, 1]) > r_m
    return int(np.count_nonzero(beyond | (np.abs(errors_m[:, 2]) > h_m)))


def least_ellipsoid(errors_m: FloatArray, dropped: int) -> Ellipsoid:
    """Return the ellipsoid of least volume about the truth with ``dropped`` errors outside.

    Table 5, Kume 2010. For each ratio of the axes the smallest ellipsoid follows from sorting; the ratio is
    found by a grid search and refined about each of its minima, since other errors are left out there.

    Args:
        errors_m: (N, 3) east, north, up; N > dropped.
        dropped: Number of errors outside.
    """
    rho2 = errors_m[:, 0] ** 2 + errors_m[:, 1] ** 2
    z2 = errors_m[:, 2] ** 2
    kept = len(errors_m) - dropped

    def alpha(ratio: float) -> float:
        # the last point may be at the centre; keeps the ellipsoid from being flat
        reached = np.partition(rho2 + z2 / ratio**2, kept - 1)[kept - 1]
        return float(np.sqrt(max(reached, 1e-18)))

    def volume(log_ratio: float) -> float:
        ratio = float(np.exp(log_ratio))
        return float(3.0 * np.log(alpha(ratio)) + log_ratio)

    log_ratios = np.log(_RATIOS)
    volumes = np.array([volume(x) for x in log_ratios])
    least, log_ratio = float(volumes.min()), float(log_ratios[np.argmin(volumes)])
    ends = np.pad(log_ratios, 1, mode="edge")
    beside = np.pad(volumes, 1, constant_values=np.inf)
    for k in np.flatnonzero((volumes <= beside[:-2]) & (volumes <= beside[2:])).tolist():
        between = float(ends[k]), float(ends[k + 2])
        refined = minimize_scalar(
            volume, bounds=between, method="bounded", options={"xatol": _LOG_RATIO_TOLERANCE}
        )
        if refined.fun < least:
            least, log_ratio = float(refined.fun), float(refined.x)
    ratio = float(np.exp(log_ratio))
    return Ellipsoid(alpha(ratio), ratio * alpha(ratio))


def correlation_time(t_s: FloatArray, errors_m: FloatArray) -> float:
    """Return the integral of an error's autocorrelation about zero up to its first zero, seconds.

    A first-order Gauss-Markov process with time constant T gives 2 T, a constant bias the length of the log.

    Args:
        t_s: (N,) in order; may have gaps.
        errors_m: (N, 3) relative to the truth, not to their mean.
    """
    if len(t_s) < 3:
        return 0.0
    step = float(np.median(np.diff(t_s)))
    slot = np.round((t_s - t_s[0]) / step).astype(np.int64)
    series = np.zeros((int(slot[-1]) + 1, 3))
    present = np.zeros(len(series))
    series[slot], present[slot] = errors_m, 1.0
    size = 2 * len(series)
    power = np.sum(np.abs(np.fft.rfft(series, size, axis=0)) ** 2, axis=1)
    products = np.fft.irfft(power, size)[: len(series)]
    pairs = np.round(np.fft.irfft(np.abs(np.fft.rfft(present, size)) ** 2, size)[: len(series)])
    # beyond half the log there are too few pairs
    lags = np.flatnonzero(pairs[: max(len(series) // 2, 2)] > 0)
    correlation = products[lags] / pairs[lags] / max(products[0] / pairs[0], 1e-18)
    end = int(np.argmax(correlation <= 0.0)) if np.any(correlation <= 0.0) else len(correlation)
    return step * float(1.0 + 2.0 * correlation[1:end].sum())

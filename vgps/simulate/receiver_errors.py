"""Errors of real receivers from their logs, and Gauss-Markov processes fitted to them."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from vgps.errors import GpsLogError
from vgps.geodesy import to_enu
from vgps.model import FixClass, FloatArray, GeodeticPoint, GpsLog, IntArray, Rig
from vgps.readers.gps import read_gps_log
from vgps.survey import survey_logs

_LEAST_CORRELATION = 0.1  # an autocorrelation is noise beyond the lag where it first falls below this
_SAME_TIME_S = 0.01


@dataclass(frozen=True, kw_only=True)
class ErrorSeries:
    """Errors of a receiver's fixes, in order of time.

    Attributes:
        t_s: (N,).
        error_m: (N, 3) fix minus truth, east, north, up.
        sigma_m: (N, 3) the receiver's own sigmas; NaN where unknown.
        fix_class: (N,).
        source: The log.
    """

    t_s: FloatArray
    error_m: FloatArray
    sigma_m: FloatArray
    fix_class: tuple[FixClass, ...]
    source: Path

    def of_class(self, fix_class: FixClass) -> "ErrorSeries":
        """Return the epochs of one class."""
        rows = np.array([one is fix_class for one in self.fix_class], bool)
        classes = (fix_class,) * int(rows.sum())
        return ErrorSeries(
            t_s=self.t_s[rows],
            error_m=self.error_m[rows],
            sigma_m=self.sigma_m[rows],
            fix_class=classes,
            source=self.source,
        )


class GaussMarkov(NamedTuple):
    """A first-order Gauss-Markov process about zero.

    Attributes:
        sigma_m: Standard deviation.
        correlation_s: Correlation time.
        sigma_doubt: Relative standard deviation of the estimate sigma_m.
    """

    sigma_m: float
    correlation_s: float
    sigma_doubt: float


def read_errors(log: Path, reference: Path | None = None) -> ErrorSeries:
    """Read the errors of a receiver's log.

    Args:
        log: Of a standing receiver, or of a moving one with a reference.
        reference: A better log of the same antenna, whose RTK-fix epochs are the truth. Without one, the
            truth is the mean of the log's own RTK-fix epochs.

    Raises:
        GpsLogError: A log cannot be read or has no RTK-fix, the receiver moved without a reference, or the
            logs have no time in common.
    """
    # any start, the same for both logs
    clock = Rig(video_start_utc=datetime(2000, 1, 1, tzinfo=UTC))
    own = read_gps_log(log, clock)
    if reference is None:
        surveyed = survey_logs([log])
        return ErrorSeries(
            t_s=own.t_s, error_m=surveyed.errors_m, sigma_m=own.sigma_m, fix_class=own.fix_class, source=log
        )
    better = read_gps_log(reference, clock)
    rows, theirs = _common(own, better)
    if not len(rows):
        raise GpsLogError(
            "no fix at the time of an RTK-fix of the reference",
            file=log,
            expected=f"fixes at the times of {reference}",
            remedy="give the reference solution of the same drive",
        )
    first = theirs[0]
    place = (better.latitude_deg[first], better.longitude_deg[first], better.height_m[first])
    origin = GeodeticPoint(*(float(x) for x in place))
    error = _enu(origin, own)[rows] - _enu(origin, better)[theirs]
    classes = tuple(own.fix_class[k] for k in rows)
    return ErrorSeries(
        t_s=own.t_s[rows], error_m=error, sigma_m=own.sigma_m[rows], fix_class=classes, source=log
    )


def fit_gauss_markov(t_s: FloatArray, error_m: FloatArray) -> GaussMarkov:
    """Fit a process to the error along one axis.

    Sigma is the root mean square about the truth, which includes a constant bias; the correlation time is the
    best fit of ``exp(-lag / T)`` to the autocorrelation up to where it first falls below 0.1.

    Args:
        t_s: (N,) in order; may have gaps.
        error_m: (N,) relative to the truth, N >= 3.
    """
    step = float(np.median(np.diff(t_s)))
    slot = np.round((t_s - t_s[0]) / step).astype(np.int64)
    series, present = np.zeros(int(slot[-1]) + 1), np.zeros(int(slot[-1]) + 1)
    series[slot], present[slot] = error_m, 1.0
    products, pairs = _autocorrelation(series), np.round(_autocorrelation(present))
    # beyond half the log there are too few pairs
    lags = np.flatnonzero(pairs[: max(len(series) // 2, 2)] > 0)
    correlation = products[lags] / pairs[lags] / (products[0] / pairs[0])
    low = correlation < _LEAST_CORRELATION
    end = max(int(np.argmax(low)) if low.any() else len(lags), 2)
    lag_s, measured, weight = lags[:end] * step, correlation[:end], pairs[lags[:end]]

    def misfit(log_time: float) -> float:
        return float(np.sum(weight * (np.exp(-lag_s / np.exp(log_time)) - measured) ** 2))

    bounds = (float(np.log(0.1 * step)), float(np.log(step * len(series))))
    correlation_s = float(np.exp(minimize_scalar(misfit, bounds=bounds, method="bounded").x))
    sigma = float(np.sqrt(np.mean(error_m**2)))
    # squares are correlated over half the correlation time in both directions
    independent = max(len(t_s) * step / max(correlation_s, step), 1.0)
    return GaussMarkov(sigma, correlation_s, float(np.sqrt(0.5 / independent)))


def replay(series: ErrorSeries, t_s: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return errors (N, 3) and the receiver's sigmas (N, 3) at times (N,), from a random epoch on.

    Epochs follow each other at the log's interval, across gaps, and from the beginning after its end.

    Args:
        series: Of one class, with at least one epoch.
        t_s: In order.
        rng: Chooses the first epoch.
    """
    count = len(series.t_s)
    step = float(np.median(np.diff(series.t_s))) if count > 1 else 1.0
    at = (rng.integers(count) + (t_s - t_s[:1]) / step) % count
    before = np.floor(at).astype(np.int64) % count
    share = (at - np.floor(at))[:, None]
    error = (1 - share) * series.error_m[before] + share * series.error_m[(before + 1) % count]
    return error, series.sigma_m[before]


def axes(series: ErrorSeries) -> Sequence[GaussMarkov]:
    """Return the process of each axis: east, north, up."""
    return [fit_gauss_markov(series.t_s, series.error_m[:, axis]) for axis in range(3)]


def _autocorrelation(series: FloatArray) -> FloatArray:
    """Return sums of products at every lag."""
    size = 2 * len(series)
    products: FloatArray = np.fft.irfft(np.abs(np.fft.rfft(series, size)) ** 2, size)[: len(series)]
    return products


def _common(own: GpsLog, better: GpsLog) -> tuple[IntArray, IntArray]:
    """Return the rows of both logs at common times, the reference's being RTK-fix."""
    fixed = np.flatnonzero([one is FixClass.RTK_FIX for one in better.fix_class])
    if not len(fixed):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    nearest = fixed[np.abs(own.t_s[:, None] - better.t_s[fixed][None]).argmin(axis=1)]
    rows = np.flatnonzero(np.abs(own.t_s - better.t_s[nearest]) < _SAME_TIME_S)
    return rows, nearest[rows]


def _enu(origin: GeodeticPoint, log: GpsLog) -> FloatArray:
    return to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m)

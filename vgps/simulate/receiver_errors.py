"""Gauss-Markov processes fitted to the errors of real receivers, and these errors replayed."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from vgps.model import FloatArray
from vgps.survey import ErrorSeries

_LEAST_CORRELATION = 0.1  # an autocorrelation is noise beyond the lag where it first falls below this


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

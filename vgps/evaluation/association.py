"""Association of two trajectories in time."""

import numpy as np

from vgps.model import FloatArray, IntArray


def match_times(estimate_s: FloatArray, truth_s: FloatArray, tolerance_s: float) -> tuple[IntArray, IntArray]:
    """Return the rows of two time series that are mutual nearest neighbours.

    Args:
        estimate_s, truth_s: (N,) and (M,) times [s] in any order, at least one each.
        tolerance_s: Largest time difference of a pair [s].

    Returns:
        Two (K,) arrays of rows, in the order of the estimate; no row occurs twice.
    """
    to_truth, to_estimate = _nearest(estimate_s, truth_s), _nearest(truth_s, estimate_s)
    rows = np.arange(len(estimate_s))
    mutual = to_estimate[to_truth] == rows
    close = np.abs(estimate_s - truth_s[to_truth]) <= tolerance_s
    chosen = rows[mutual & close]
    return chosen, to_truth[chosen]


def half_interval_s(t_s: FloatArray) -> float:
    """Return half the median interval between times (N,), or 1 ms for a single time."""
    intervals = np.diff(np.unique(t_s))
    return float(np.median(intervals)) / 2 if len(intervals) else 1e-3


def _nearest(times_s: FloatArray, among_s: FloatArray) -> IntArray:
    order = np.argsort(among_s, kind="stable")
    ordered = among_s[order]
    right = np.clip(np.searchsorted(ordered, times_s), 0, len(ordered) - 1)
    left = np.maximum(right - 1, 0)
    nearer_left = times_s - ordered[left] <= ordered[right] - times_s
    return order[np.where(nearer_left, left, right)]

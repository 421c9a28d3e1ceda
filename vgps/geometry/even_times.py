"""Even times in place of time stamps that a computer gave to measurements as they came, some of them late.

Sensors measure at even times. Of two sets of times, a path is smoother over the right one.
"""

import numpy as np

from vgps.model import FloatArray

CLEAR = float(np.log(100.0))
"""Log of how much likelier a path has to be over other times than its time stamps, for these to be right."""
_SIGMAS = 4.0  # of the interval that stamps show, within which a whole one is the true one
_STILL_M_S3 = 1e-6  # added to all jerks, which may be zero


def even_times(t_s: FloatArray, whole_s: float = 0.0) -> FloatArray:
    """Return the times (n,) on a line through time stamps.

    Either some are missing, where a step is of several intervals, or none is, and a step is long because
    something came late. The line is that of the two which is closer to the stamps.

    Args:
        t_s: (n,) time stamps, strictly increasing, two or more.
        whole_s: The interval is a multiple of this if it may be one.
    """
    steps = np.diff(t_s)
    interval_s = float(np.median(steps / np.maximum(np.round(steps / np.median(steps)), 1.0)))
    counts = np.ones(len(steps)), np.maximum(np.round(steps / interval_s), 1.0)
    lines = [_line(t_s, np.append(0.0, np.cumsum(count)), whole_s) for count in counts]
    return min(lines, key=lambda line_s: float(np.mean(np.abs(t_s - line_s))))


def _line(t_s: FloatArray, number: FloatArray, whole_s: float) -> FloatArray:
    """Return the times (n,) on the line through those of numbered things."""
    centred = number - number.mean()
    interval_s = float(centred @ t_s / (centred @ centred))
    unsure_s = float(np.std(t_s - t_s.mean() - interval_s * centred) / np.linalg.norm(centred))
    if whole_s and abs(interval_s - round(interval_s / whole_s) * whole_s) < _SIGMAS * unsure_s:
        interval_s = round(interval_s / whole_s) * whole_s
    return np.asarray(t_s.mean() + interval_s * centred)


def smoother_by(times_s: tuple[FloatArray, FloatArray], place_m: FloatArray) -> float:
    """Return how much smoother a path is over the second of two times: the log of the likelihoods' ratio.

    It is that of jerks of unknown size. Jerks of which a place is unknown do not count.

    Args:
        times_s: Twice (n,), strictly increasing.
        place_m: (n, 2) or (n, 3) places, NaN where unknown.
    """
    before, after = (_jerks(t_s, place_m) for t_s in times_s)
    # A jerk has two or three axes, but shares most of its places with its neighbours: it counts once.
    return float(np.nansum(np.log(before / after)))


def _jerks(t_s: FloatArray, place_m: FloatArray) -> FloatArray:
    """Return a sixth of the jerks (n - 3,): the third divided differences of places over times."""
    differences = place_m
    for order in (1, 2, 3):
        differences = np.diff(differences, axis=0) / (t_s[order:] - t_s[:-order])[:, None]
    return np.asarray(np.linalg.norm(differences, axis=1) + _STILL_M_S3)

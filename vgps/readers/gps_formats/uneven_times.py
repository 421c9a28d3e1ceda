"""Time stamps that a computer gave to fixes as they came, some later than others.

A receiver solves for its position at even times. At 10 m/s a stamp that is off by 0.05 s moves an RTK-fix by
half a metre, a hundred times its error. Over the right times positions move more smoothly.
"""

from typing import NamedTuple

import numpy as np

from vgps.model import FloatArray

_SMALL_M = 0.01  # that fixes move in the time by which stamps are off: no receiver is better than that
_MOST = 0.25  # of the interval between fixes, by which they may be off
_LEAST_FIXES = 8
_SIGMAS = 4.0  # of the interval that stamps show, within which a whole hundredth of a second is the true one
_CLEAR = float(np.log(100.0))  # of the ratio of the likelihoods
_STILL_M_S3 = 1e-6  # added to all jerks, which may be zero
_FOUND = (
    "the time stamps of the fixes are up to {0:.3f} s off even times, over which the positions move more "
    "smoothly: fixes have the even times"
)
_UNSURE = (
    "the time stamps of the fixes are {0:.3f} s off even times, and positions do not tell which are right: "
    "what a fix moves in that time counts as an error"
)


class FixTimes(NamedTuple):
    """Times of fixes (N,), how far they may be off (standard deviation), and what is to be told of them."""

    t_s: FloatArray
    sigma_s: float = 0.0
    notes: tuple[str, ...] = ()


def fix_times(t_s: FloatArray, place_m: FloatArray) -> FixTimes:
    """Return the times of fixes: their time stamps, or even ones if their places speak for these.

    Args:
        t_s: (N,) time stamps, strictly increasing.
        place_m: (N, 2) places in a plane.
    """
    even_s = _even_times(t_s) if len(t_s) >= _LEAST_FIXES else None
    if even_s is None:
        return FixTimes(t_s)
    off_s = float(np.std(t_s - even_s))
    speed_m_s = float(np.sum(np.linalg.norm(np.diff(place_m, axis=0), axis=1)) / np.ptp(t_s))
    if off_s * speed_m_s < _SMALL_M or off_s > _MOST * float(np.median(np.diff(even_s))):
        return FixTimes(t_s)
    # the log of the likelihoods' ratio, the size of jerks unknown; of two axes, but every second jerk is new
    gain = float(np.sum(np.log(_jerks(t_s, place_m) / _jerks(even_s, place_m))))
    if gain > _CLEAR:
        return FixTimes(even_s, notes=(_FOUND.format(np.abs(t_s - even_s).max()),))
    return FixTimes(t_s) if gain < -_CLEAR else FixTimes(t_s, off_s, (_UNSURE.format(off_s),))


def _even_times(t_s: FloatArray) -> FloatArray | None:
    """Return the times on a line through time stamps, some of which may be missing; None if there is none.

    Receivers measure at whole hundredths of a second: such an interval is taken if it may be the one.
    """
    steps = np.diff(t_s)
    interval_s = float(np.median(steps / np.maximum(np.round(steps / np.median(steps)), 1.0)))
    number = np.append(0.0, np.cumsum(np.round(steps / interval_s)))
    if (np.diff(number) < 1.0).any():
        return None
    centred = number - number.mean()
    interval_s = float(centred @ t_s / (centred @ centred))
    off_s = t_s - t_s.mean() - interval_s * centred
    unsure_s = float(np.std(off_s) / np.linalg.norm(centred))
    if abs(interval_s - round(interval_s, 2)) < _SIGMAS * unsure_s:
        interval_s = round(interval_s, 2)
    return np.asarray(t_s.mean() + interval_s * centred)


def _jerks(t_s: FloatArray, place_m: FloatArray) -> FloatArray:
    """Return a sixth of the jerks (N - 3,): the third divided differences of places (N, 2) over times."""
    differences = place_m
    for order in (1, 2, 3):
        differences = np.diff(differences, axis=0) / (t_s[order:] - t_s[:-order])[:, None]
    return np.asarray(np.linalg.norm(differences, axis=1) + _STILL_M_S3)

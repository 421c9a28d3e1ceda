"""Time stamps that a computer gave to fixes as they came, some later than others.

A receiver solves for its position at even times. At 10 m/s a stamp that is off by 0.05 s moves an RTK-fix by
half a metre, a hundred times its error. Over the right times positions move more smoothly.
"""

from typing import NamedTuple

import numpy as np

from vgps.geometry.even_times import CLEAR, even_times, smoother_by
from vgps.model import FloatArray

_SMALL_M = 0.01  # that fixes move in the time by which stamps are off: no receiver is better than that
_MOST = 0.25  # of the interval between fixes, by which they may be off
_LEAST_FIXES = 8
_WHOLE_S = 0.01  # receivers measure at multiples of it
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
    if len(t_s) < _LEAST_FIXES:
        return FixTimes(t_s)
    even_s = even_times(t_s, _WHOLE_S)
    off_s = float(np.std(t_s - even_s))
    speed_m_s = float(np.sum(np.linalg.norm(np.diff(place_m, axis=0), axis=1)) / np.ptp(t_s))
    if off_s * speed_m_s < _SMALL_M or off_s > _MOST * float(np.median(np.diff(even_s))):
        return FixTimes(t_s)
    gain = smoother_by((t_s, even_s), place_m)
    if gain > CLEAR:
        return FixTimes(even_s, notes=(_FOUND.format(np.abs(t_s - even_s).max()),))
    return FixTimes(t_s) if gain < -CLEAR else FixTimes(t_s, off_s, (_UNSURE.format(off_s),))

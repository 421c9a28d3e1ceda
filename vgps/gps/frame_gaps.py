"""Gaps between frames, where a recorder dropped some: what the camera did meanwhile is unknown.

Between two frames the path is a straight line. With white noise of the density q on the acceleration, the
camera is off the middle of T seconds by ``q T^1.5 / (4 sqrt(3))``: with the 2 m/s^2/sqrt(Hz) of ``motion`` by
0.05 m after 0.3 s, more than an RTK-fix errs by.
"""

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray

_USUAL = 1.5  # median intervals: longer ones are gaps
_SHORT_S = 0.3  # shorter ones are none
_ROUNDED = 1.001  # times an interval, by which time stamps make it longer


def frame_gaps(frame_t_s: FloatArray) -> IntArray:
    """Return the frames (G,) before gaps; ``frame_t_s`` (F,) are the times of all frames, ascending."""
    interval_s = np.diff(frame_t_s)
    usual_s = float(np.median(interval_s)) if len(interval_s) else 0.0
    return np.flatnonzero(interval_s > _ROUNDED * max(_SHORT_S, _USUAL * usual_s))


def in_gaps(frame_t_s: FloatArray, t_s: FloatArray, reach_s: float = 0.0) -> BoolArray:
    """Return which times (M,) are in a gap between frames, or nearer to one than ``reach_s``.

    Args:
        frame_t_s: (F,) times of the frames, ascending.
        t_s: (M,) times.
        reach_s: Seconds.
    """
    gaps = frame_gaps(frame_t_s)
    begun = np.searchsorted(frame_t_s[gaps] - reach_s, t_s, side="left")
    ended = np.searchsorted(frame_t_s[gaps + 1] + reach_s, t_s, side="right")
    return np.asarray(begun > ended)

"""Logs with a position for each frame, that a program interpolated between those of a receiver."""

import numpy as np

from vgps.geodesy import to_enu
from vgps.model import BoolArray, FloatArray, GeodeticPoint
from vgps.readers.gps_formats.fixes import Fix, skipped

_EXACT_M = 0.001  # from the line between its neighbours: no receiver measures that well
_BEND = 6.0  # times as far are the receiver's own
_LEAST = 5  # of these
_APART = 3.0  # fixes from one to the next
_ALONE = 0.9  # share of these with interpolated neighbours; two together have the receiver's between them
_MOST_TOGETHER = 2


def without_interpolated(fixes: list[Fix]) -> tuple[list[Fix], list[str]]:
    """Return the fixes without those on the line between their neighbours, and a note on these.

    Their error is that of the fixes around them, and how the path bends in between. Most fixes of such a log
    are on that line to less than a millimetre, with single ones off it.

    Args:
        fixes: In order of time.
    """
    if len(fixes) < _LEAST:
        return fixes, []
    t_s, *place = np.array([fix[:4] for fix in fixes], float).T
    place_m = to_enu(GeodeticPoint(*fixes[0][1:4]), *place)[:, :2]
    off_m = _off_the_line(t_s, place_m)
    exact_m = float(np.median(off_m))
    own = off_m > _BEND * (exact_m + 0.1 * _EXACT_M)
    if exact_m > _EXACT_M or not _are_apart(own):
        return fixes, []
    keep = np.concatenate([[True], own, [True]])
    between = np.stack([np.interp(t_s, t_s[keep], axis[keep]) for axis in place_m.T], axis=1)
    if np.median(np.linalg.norm(place_m - between, axis=1)) > _EXACT_M:  # an inertial path, with corrections
        return fixes, []
    kept = [fix for fix, its_own in zip(fixes, keep.tolist(), strict=True) if its_own]
    return kept, skipped(len(fixes) - len(kept), "fix", "interpolated between others")


def _off_the_line(t_s: FloatArray, place_m: FloatArray) -> FloatArray:
    """Return how far (N - 2,) places (N, 2) are from the lines between their neighbours."""
    share = ((t_s[1:-1] - t_s[:-2]) / (t_s[2:] - t_s[:-2]))[:, None]
    line = (1.0 - share) * place_m[:-2] + share * place_m[2:]
    return np.asarray(np.linalg.norm(place_m[1:-1] - line, axis=1))


def _are_apart(own: BoolArray) -> bool:
    """Return whether there are enough fixes of the receiver's own, with interpolated ones in between."""
    first, end = np.flatnonzero(np.diff(own.astype(int), prepend=0, append=0)).reshape(-1, 2).T
    alone = end - first <= _MOST_TOGETHER
    return len(first) >= _LEAST and alone.mean() >= _ALONE and float(np.median(np.diff(first))) > _APART

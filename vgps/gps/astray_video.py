"""Fixes that were refused though no receiver errs like that: the video went astray instead.

The errors of a receiver that solves for carrier phases jump, and stay. Those of a path that leaves the fixes,
as after a zoom or under electronic stabilisation, change from each fix to the next in one direction, by more
than a region.
"""

from collections.abc import Sequence

import numpy as np

from vgps.gps.fixes import one_per_interval
from vgps.gps.verdicts import are_refused
from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.solution import FixTable, Verdict

_FIXES = 5  # in a row: errors at random are straight in one of 40,000 cases, a walk at random in 140
_INTERVAL_S = 1.0  # between the fixes compared: errors of closer ones change too little
_LONGEST_GAP_S = 5.0  # between them: more may be several jumps
_STRAIGHT = 0.9  # of the sum of the steps is the distance from the first error to the last
_LEAST_M = 2.0  # this distance: more than wrong integers, or a receiver that bridges an outage, err within it


def left_by_the_video(table: FixTable, fix_class: Sequence[FixClass], t_s: FloatArray) -> IntArray:
    """Return the rows of the fixes that the path of the video left behind, one a second, in order.

    Args:
        table: Verdicts, residuals and regions of the fixes (M,) of a run.
        fix_class: (M,) their classes.
        t_s: (M,) their times.
    """
    names, verdicts = np.array(fix_class, dtype=str), np.array(table.verdict, dtype=str)
    by_phase = np.isin(names, [FixClass.RTK_FIX, FixClass.RTK_FLOAT])
    rows = np.flatnonzero(by_phase & (verdicts != Verdict.NOT_USED))
    rows = rows[one_per_interval(t_s[rows], _INTERVAL_S)]
    refused = are_refused(table, fix_class)[rows]
    changes = refused[1:] & refused[:-1] & _is_another_error(table, rows)
    changes &= np.diff(t_s[rows]) <= _LONGEST_GAP_S
    begins = [
        first
        for first in range(len(rows) - _FIXES + 1)
        if changes[first : first + _FIXES - 1].all() and _is_straight(table.residual_m[rows[first:][:_FIXES]])
    ]
    left = np.add.outer(np.array(begins, dtype=np.int64), np.arange(_FIXES))
    return np.asarray(rows[np.unique(left)])


def astray_note(rows: IntArray, table: FixTable, t_s: FloatArray) -> str:
    """Return what the user should know of a run that believes all fixes, as a video left these behind."""
    apart_m = float(np.linalg.norm(table.residual_m[rows], axis=1).max())
    return (
        f"the video went astray: its path left fixes behind between {t_s[rows[0]]:.1f} and "
        f"{t_s[rows[-1]]:.1f} s, {apart_m:.1f} m at most, and by another distance from each to the next, as "
        "no RTK receiver errs. So this run believes all fixes; between them it is poor, and its standard "
        "deviations are too small. A zoom looks like that, or electronic stabilisation: see vgps inspect"
    )


def _is_another_error(table: FixTable, rows: IntArray) -> BoolArray:
    """Return whether each fix (n,) but the first errs by over a region otherwise than the one before it."""
    step, r, h = np.diff(table.residual_m[rows], axis=0), table.r_m[rows], table.h_m[rows]
    plane, height = np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])
    return np.asarray((plane > np.maximum(r[1:], r[:-1])) | (height > np.maximum(h[1:], h[:-1])))


def _is_straight(error_m: FloatArray) -> bool:
    """Return whether errors (n, 3) change in one direction, and far."""
    length_m = np.linalg.norm(np.diff(error_m, axis=0), axis=1).sum()
    return bool(np.linalg.norm(error_m[-1] - error_m[0]) > max(_STRAIGHT * length_m, _LEAST_M))

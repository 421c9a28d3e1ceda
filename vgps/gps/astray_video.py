"""Fixes that were refused though no receiver errs like that: the video went astray instead.

The errors of a receiver that solves for carrier phases jump and stay, or drift slowly. If the path leaves
right fixes, as after a zoom, the distance between them changes evenly, in one direction, and by metres.
"""

from collections.abc import Sequence

import numpy as np

from vgps.gps.fixes import one_per_interval
from vgps.gps.verdicts import are_refused
from vgps.model import FixClass, FloatArray, IntArray
from vgps.solution import FixTable, Verdict

_FIXES = 5  # in a row
_INTERVAL_S = 1.0  # between the fixes compared: errors of closer ones change too little
_LONGEST_GAP_S = 5.0  # between them: more may be several jumps
_STRAIGHT = 0.9  # of the sum of the steps is the distance from the first error to the last
_LARGEST = 0.5  # of this sum is one step at most: with one jump a receiver may err so
_LEAST_M = 5.0  # this distance, in the plane: RTK-floats drift by a metre in it, and by several in height


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
    in_row = refused[1:] & refused[:-1] & (np.diff(t_s[rows]) <= _LONGEST_GAP_S)
    begins = [
        first
        for first in range(len(rows) - _FIXES + 1)
        if in_row[first : first + _FIXES - 1].all() and _drifts(table.residual_m[rows[first:][:_FIXES], :2])
    ]
    left = np.add.outer(np.array(begins, dtype=np.int64), np.arange(_FIXES))
    return np.asarray(rows[np.unique(left)])


def astray_note(rows: IntArray, table: FixTable, t_s: FloatArray) -> str:
    """Return what the user should know of a run that believes all fixes, as a video left these behind."""
    apart_m = float(np.linalg.norm(table.residual_m[rows], axis=1).max())
    return (
        f"the video went astray: its path left fixes behind between {t_s[rows[0]]:.1f} and "
        f"{t_s[rows[-1]]:.1f} s, {apart_m:.1f} m at most, evenly, as no errors of an RTK receiver grow. This "
        "run believes all fixes instead; between them it is poor, and its standard deviations are too small. "
        "A zoom looks like that: see vgps inspect"
    )


def _drifts(error_m: FloatArray) -> bool:
    """Return whether errors (n, 2) change far, in one direction and not by a single step."""
    step_m = np.linalg.norm(np.diff(error_m, axis=0), axis=1)
    apart_m = np.linalg.norm(error_m[-1] - error_m[0])
    even = step_m.max() <= _LARGEST * step_m.sum()
    return bool(even and apart_m > max(_STRAIGHT * step_m.sum(), _LEAST_M))

"""Runs of fixes that may share an error, and the trials of leaving them out.

A long path has stretches. A trial leaves out one run in each of them, for what is left out in one changes
little in the others; each has its own outcome. So the number of trials does not grow with the length, and
errors are found in every stretch as they are in a short path.
"""

from dataclasses import dataclass

import numpy as np

from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Trajectory

_LESSER_JUMP = 0.5  # in regions, where a change of class explains most of what begins or ends
_STRETCH_KNOTS = 60  # of the drift model: so many changes leave the drift at one end free of the other's


@dataclass(frozen=True)
class Stretches:
    """Stretches of a path, as equal as possible.

    Attributes:
        count: Number of stretches.
        of_fix: (M,) stretch of each fix.
        of_interval: (K - 1,) stretch of each interval between knots of the drift model.
    """

    count: int
    of_fix: IntArray
    of_interval: IntArray

    @classmethod
    def along(cls, path: Trajectory, fixes: Fixes, knots: int) -> "Stretches":
        """Return the stretches of a path with so many knots, and where its fixes (M,) lie."""
        count = -(-(knots - 2) // _STRETCH_KNOTS) or 1
        frame = place(path.t_s, fixes.t_s).frame
        return cls(count, frame * count // len(path), np.arange(knots - 1) * count // (knots - 1))

    def sums(self, of_fixes: FloatArray, of_intervals: FloatArray) -> FloatArray:
        """Return the sums (S,) over each stretch of values of fixes (M,) and of intervals (K - 1,)."""
        by_fixes = np.bincount(self.of_fix, of_fixes, self.count)
        return np.asarray(
            by_fixes + np.bincount(self.of_interval, of_intervals, self.count), dtype=np.float64
        )


def suspect_runs(
    beyond: FloatArray, accepted: BoolArray, stretches: Stretches, max_jumps: int
) -> list[list[IntArray]]:
    """Return the runs between jumps that may share an error, as rows of fixes, for every stretch.

    Args:
        beyond: (N - 1,) change of the offset from one accepted fix to the next, in regions. A stretch with a
            jump beyond 1 is suspect; the other end of its wrong run may be less of a jump.
        accepted: (M,) the N fixes to consider.
        stretches: Of the path.
        max_jumps: Number of jumps in a stretch, the largest ones, to consider.
    """
    rows = np.flatnonzero(accepted)
    of_row = stretches.of_fix[rows]
    largest = np.zeros(stretches.count)
    np.maximum.at(largest, of_row[:-1], beyond)
    jumps = np.flatnonzero((beyond > _LESSER_JUMP) & (largest[of_row[:-1]] > 1.0))
    jumps = jumps[np.lexsort((-beyond[jumps], of_row[jumps]))]
    rank = np.arange(len(jumps)) - np.searchsorted(of_row[jumps], of_row[jumps])
    ends = np.sort(jumps[rank < max_jumps]) + 1
    most = np.bincount(of_row, minlength=stretches.count) // 2
    runs: list[list[IntArray]] = [[] for _ in range(stretches.count)]
    for run in np.split(rows, ends):
        if len(run) >= 2:
            stretch = int(stretches.of_fix[run[len(run) // 2]])
            if len(run) <= most[stretch]:
                runs[stretch].append(run)
    return runs


def trial_masks(runs: list[list[IntArray]], count: int) -> list[BoolArray]:
    """Return masks (M,) of ``count`` fixes, each of one run in every stretch that has as many."""
    masks = [np.zeros(count, dtype=bool) for _ in range(max(map(len, runs)))]
    for of_stretch in runs:
        for mask, run in zip(masks, of_stretch, strict=False):
            mask[run] = True
    return masks


def better_without(runs: list[list[IntArray]], energies: FloatArray, before: FloatArray) -> list[IntArray]:
    """Return the run of each stretch whose trial lowered its energy most, if one did.

    Args:
        runs: Of every stretch.
        energies: (T, S) of each trial in each stretch.
        before: (S,) without any trial.
    """
    found = []
    for stretch, of_stretch in enumerate(runs):
        if of_stretch:
            trial = int(np.argmin(energies[: len(of_stretch), stretch]))
            if energies[trial, stretch] < before[stretch]:
                found.append(of_stretch[trial])
    return found

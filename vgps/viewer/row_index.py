"""Rows of the observations and fixes by frame and by landmark."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solution import Solution
from vgps.viewer.measures import ReprojectedObservations, fix_placement, gps_terms, video_terms


@dataclass(frozen=True)
class Lookup:
    """What acts on a frame or on a landmark, found in one step.

    Attributes:
        solution: The run.
        seen: Its observations, sorted by frame.
    """

    solution: Solution
    seen: ReprojectedObservations

    @cached_property
    def phi(self) -> FloatArray:
        """(F,) Phi_i, Eq. (12), Kume 2010, see `video_terms`."""
        return video_terms(self.solution, self.seen)

    @cached_property
    def gps(self) -> FloatArray:
        """(M,) omega Psi of each fix."""
        return gps_terms(self.solution)

    @cached_property
    def lengths_px(self) -> FloatArray:
        """(N,) lengths of the reprojection errors."""
        return self.seen.length_px

    @cached_property
    def _first_row(self) -> IntArray:
        return np.concatenate([[0], np.cumsum(self.seen.per_frame)])

    @cached_property
    def _by_landmark(self) -> tuple[IntArray, IntArray]:
        order = np.argsort(self.seen.landmark, kind="stable")
        count = len(self.solution.landmarks.sigma_px)
        return order, np.searchsorted(self.seen.landmark[order], np.arange(count + 1))

    def rows_of_frame(self, frame: int) -> tuple[int, int]:
        """First row of the observations, and the row after the last."""
        return int(self._first_row[frame]), int(self._first_row[frame + 1])

    def of_frame(self, frame: int) -> slice:
        """Rows of the observations."""
        return slice(*self.rows_of_frame(frame))

    def of_landmark(self, landmark: int) -> IntArray:
        """Rows of the observations, in order of time."""
        order, first = self._by_landmark
        return order[first[landmark] : first[landmark + 1]]

    @cached_property
    def fixes_of_frame(self) -> dict[int, list[int]]:
        """The fixes whose factors act on each frame: the one before and the one after."""
        acting: dict[int, list[int]] = {}
        if self.solution.fixes is None or self.solution.gps is None:
            return acting
        before = fix_placement(self.solution).frame
        for row in np.flatnonzero(self.solution.fixes.used):
            for frame in (before[row], before[row] + 1):
                acting.setdefault(int(frame), []).append(int(row))
        return acting

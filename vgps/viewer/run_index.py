"""Rows of the observations and fixes by frame and by landmark."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solution import Solution
from vgps.viewer.residuals import ReprojectedObservations, fix_placement, gps_terms, video_terms


@dataclass(frozen=True)
class RunIndex:
    """The factors on each frame and each landmark of a run, with their values.

    Attributes:
        solution: The run.
        observations: Its observations, sorted by frame.
    """

    solution: Solution
    observations: ReprojectedObservations

    @cached_property
    def video_terms(self) -> FloatArray:
        """(F,) Phi_i, Eq. (12), Kume 2010, see `vgps.viewer.residuals.video_terms`."""
        return video_terms(self.solution, self.observations)

    @cached_property
    def gps_terms(self) -> FloatArray:
        """(M,) omega Psi of each fix."""
        return gps_terms(self.solution)

    @cached_property
    def lengths_px(self) -> FloatArray:
        """(N,) lengths of the reprojection errors."""
        return self.observations.length_px

    @cached_property
    def _first_row(self) -> IntArray:
        return np.concatenate([[0], np.cumsum(self.observations.per_frame)])

    @cached_property
    def _by_landmark(self) -> tuple[IntArray, IntArray]:
        order = np.argsort(self.observations.landmark, kind="stable")
        count = len(self.solution.landmarks.sigma_px)
        return order, np.searchsorted(self.observations.landmark[order], np.arange(count + 1))

    def rows_of_frame(self, frame: int) -> slice:
        """Return the rows of the observations in a frame."""
        return slice(int(self._first_row[frame]), int(self._first_row[frame + 1]))

    def rows_of_landmark(self, landmark: int) -> IntArray:
        """Return the rows of the observations of a landmark, in order of time."""
        order, first = self._by_landmark
        return order[first[landmark] : first[landmark + 1]]

    @cached_property
    def fixes_of_frame(self) -> dict[int, list[int]]:
        """The fixes whose factors act on a frame: a factor acts on the frames before and after its fix."""
        fixes: dict[int, list[int]] = {}
        if self.solution.fixes is None:
            return fixes
        before = fix_placement(self.solution).frame
        for row in np.flatnonzero(self.solution.fixes.used):
            for frame in (before[row], before[row] + 1):
                fixes.setdefault(int(frame), []).append(int(row))
        return fixes

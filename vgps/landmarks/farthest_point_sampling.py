"""Which of the frames that saw a landmark are kept as its views: few, spread in direction and scale."""

from dataclasses import dataclass

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray

_ERROR_UNIT_PX = 1.0  # a reprojection error of this size makes a difference count half


@dataclass(frozen=True)
class ViewMetric:
    """How differences in direction and in scale compare: so many degrees, or so many octaves, are one."""

    angle_unit_deg: float
    octave_unit: float

    def coordinates(self, direction: FloatArray, octave: FloatArray) -> FloatArray:
        """(N, 4) whose distances are the differences, from unit directions (N, 3) and log2 of scales (N,)."""
        return np.column_stack([direction / np.radians(self.angle_unit_deg), octave / self.octave_unit])


def farthest_point_sampling(
    landmark: IntArray, place: FloatArray, error_px: FloatArray, count: int, least: float
) -> BoolArray:
    """Choose up to ``count`` observations of each landmark, each time the one furthest from those chosen.

    The first is the one with the least error; then the furthest from all chosen before, a large error
    counting against it.

    Args:
        landmark: (N,) sorted.
        place: (N, D) from where each was seen.
        error_px: (N,) reprojection error.
        count: Most for a landmark.
        least: One that is no further than this from a chosen one is not taken.

    Returns:
        (N,) whether each was chosen.
    """
    chosen = np.zeros(len(landmark), bool)
    if not len(chosen):
        return chosen
    first = np.flatnonzero(np.diff(landmark, prepend=landmark[0] - 1))
    owner = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(landmark))))
    trust = 1 / (1 + error_px / _ERROR_UNIT_PX)
    distance = np.full(len(landmark), np.inf)
    merit = trust
    for _ in range(count):
        best = _largest(merit, first, owner)
        best = best[distance[best] > least]
        chosen[best] = True
        newest = np.full(len(first), -1)
        newest[owner[best]] = best
        step = np.linalg.norm(place - place[newest[owner]], axis=1)
        distance = np.where(newest[owner] < 0, distance, np.minimum(distance, step))
        merit = distance * trust
    return chosen


def _largest(values: FloatArray, first: IntArray, owner: IntArray) -> IntArray:
    """(M,) row of the largest value of each group, the earliest of equals."""
    largest = np.flatnonzero(values == np.maximum.reduceat(values, first)[owner])
    return np.asarray(largest[np.unique(owner[largest], return_index=True)[1]])

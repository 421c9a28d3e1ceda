"""Farthest point sampling of the views of a landmark: few of them, spread in direction and scale."""

from dataclasses import dataclass

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class ViewMetric:
    """A distance between views: so many degrees of direction, or so many octaves of scale, count as one."""

    angle_unit_deg: float
    octave_unit: float

    def coordinates(self, direction: FloatArray, octave: FloatArray) -> FloatArray:
        """Return coordinates (N, 4) whose Euclidean distance is the distance between views.

        Args:
            direction: (N, 3) unit vectors.
            octave: (N,) log2 of the scales.
        """
        return np.column_stack([direction / np.radians(self.angle_unit_deg), octave / self.octave_unit])


def sample_farthest(
    landmark: IntArray, place: FloatArray, error: FloatArray, count: int, min_distance: float
) -> BoolArray:
    """Select up to ``count`` observations of each landmark by farthest point sampling.

    The first is the one with the least error. Each further one is the farthest from those already selected,
    its distance discounted by its reprojection error.

    Args:
        landmark: (N,) sorted.
        place: (N, D) coordinates of each observation, see :meth:`ViewMetric.coordinates`.
        error: (N,) reprojection errors, in units that halve the weight of a distance.
        count: Most observations per landmark.
        min_distance: Observations no farther than this from a selected one are left out.

    Returns:
        (N,) whether each is selected.
    """
    selected = np.zeros(len(landmark), bool)
    if not len(selected):
        return selected
    first = np.flatnonzero(np.diff(landmark, prepend=landmark[0] - 1))
    owner = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(landmark))))
    trust = 1 / (1 + error)
    distance = np.full(len(landmark), np.inf)
    merit = trust
    for _ in range(count):
        best = _largest(merit, first, owner)
        best = best[distance[best] > min_distance]
        selected[best] = True
        newest = np.full(len(first), -1)
        newest[owner[best]] = best
        step = np.linalg.norm(place - place[newest[owner]], axis=1)
        distance = np.where(newest[owner] < 0, distance, np.minimum(distance, step))
        merit = distance * trust
    return selected


def _largest(values: FloatArray, first: IntArray, owner: IntArray) -> IntArray:
    """Return the row (M,) of the largest value of each group, the earliest of equals."""
    largest = np.flatnonzero(values == np.maximum.reduceat(values, first)[owner])
    return np.asarray(largest[np.unique(owner[largest], return_index=True)[1]])

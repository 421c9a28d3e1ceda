"""Landmarks in cells: neighbours in space that were seen equally large, kept and read together."""

from dataclasses import dataclass

import numpy as np

from vgps.landmarks.model import LandmarkViews
from vgps.model import FloatArray, IntArray


@dataclass(frozen=True)
class Cell:
    """The landmarks of one cell and their views; numbers as they stand in the database.

    Attributes:
        landmark: (n,) ids.
        numbers: (n, 5) position, sigma_px, position_sigma_m.
        count: (n,) views of each landmark.
        view_numbers: (m, 9) world_p_camera, world_v_column, world_v_row, sorted by landmark.
    """

    landmark: IntArray
    numbers: FloatArray
    count: IntArray
    view_numbers: FloatArray


def pixel_sizes_m(views: LandmarkViews) -> FloatArray:
    """(N,) metres that a template's pixel covers at level 0: the scale (D) of Matsuda 2007."""
    column, row = (np.linalg.norm(v, axis=1) for v in (views.world_v_column, views.world_v_row))
    return np.asarray(np.sqrt(column * row))


def partition(points: FloatArray, octave: IntArray, size: int) -> list[IntArray]:
    """Rows of points in groups of at most ``size``, near each other and of one octave.

    Args:
        points: (N, 3) metres.
        octave: (N,) of the scale at which each was seen.
        size: Groups are halved across their widest axis until they hold no more.

    Returns:
        Rows of each group; together every row once.
    """
    waiting = [np.flatnonzero(octave == value) for value in np.unique(octave)[::-1]]
    done = []
    while waiting:
        rows = waiting.pop()
        if len(rows) <= size:
            done.append(np.sort(rows))
            continue
        inside = points[rows]
        axis = int(np.argmax(np.ptp(inside, axis=0)))
        order = rows[np.argsort(inside[:, axis], kind="stable")]
        half = len(order) // 2
        waiting += [order[half:], order[:half]]
    return done


def concatenated_ranges(first: IntArray, count: IntArray) -> IntArray:
    """first[0], first[0] + 1, ..., ``count[0]`` of them; then the same for the next."""
    start = np.repeat(first - (np.cumsum(count) - count), count)
    return np.asarray(start + np.arange(len(start)))

"""Cells: landmarks close in space and of similar scale, which the database stores and reads together."""

from dataclasses import dataclass

import numpy as np

from vgps.landmarks.model import LandmarkViews
from vgps.model import FloatArray, IntArray


@dataclass(frozen=True)
class Cell:
    """The landmarks of one cell and their views, as the database stores them.

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
    """Return the metres (N,) that a template pixel covers at level 0: the scale (D) of Matsuda 2007."""
    column, row = (np.linalg.norm(v, axis=1) for v in (views.world_v_column, views.world_v_row))
    return np.asarray(np.sqrt(column * row))


def partition(points: FloatArray, octave: IntArray, size: int) -> list[IntArray]:
    """Partition points into groups of one octave and at most ``size`` neighbours.

    Groups are halved across their widest axis until they are small enough.

    Args:
        points: (N, 3) metres.
        octave: (N,) log2 of the scale of each point.
        size: Most points of a group.

    Returns:
        Rows of each group; every row is in exactly one group.
    """
    pending = [np.flatnonzero(octave == value) for value in np.unique(octave)[::-1]]
    groups = []
    while pending:
        rows = pending.pop()
        if len(rows) <= size:
            groups.append(np.sort(rows))
            continue
        inside = points[rows]
        axis = int(np.argmax(np.ptp(inside, axis=0)))
        order = rows[np.argsort(inside[:, axis], kind="stable")]
        half = len(order) // 2
        pending += [order[half:], order[:half]]
    return groups


def concatenated_ranges(first: IntArray, count: IntArray) -> IntArray:
    """Return the ranges ``first[i], ..., first[i] + count[i] - 1``, one after the other."""
    start = np.repeat(first - (np.cumsum(count) - count), count)
    return np.asarray(start + np.arange(len(start)))

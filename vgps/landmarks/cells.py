"""Landmarks in cells: neighbours in space that were seen equally large, kept and read together."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vgps.landmarks.views import LandmarkViews
from vgps.model import FloatArray, IntArray

Float32Array = npt.NDArray[np.float32]


def pixel_sizes_m(views: LandmarkViews) -> FloatArray:
    """(N,) metres that a template's pixel covers at level 0: the scale (D) of Matsuda 2007."""
    column, row = (np.linalg.norm(v, axis=1) for v in (views.world_v_column, views.world_v_row))
    return np.asarray(np.sqrt(column * row))


def group(points: FloatArray, octave: IntArray, size: int) -> list[IntArray]:
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

    def looks(self, width: int) -> Float32Array:
        """(n, width, 7) of each view: direction to its camera (3), normal (3), log2 of its pixel size.

        Views that a landmark has not are NaN.
        """
        point = np.repeat(self.numbers[:, :3], self.count, axis=0)
        camera, column, row = np.split(self.view_numbers, 3, axis=1)
        normal = -np.cross(column, row)
        area = np.linalg.norm(normal, axis=1, keepdims=True)
        look = camera - point
        flat = np.hstack(
            [look / np.linalg.norm(look, axis=1, keepdims=True), normal / area, np.log2(area) / 2]
        )
        padded = np.full((len(self.landmark), width, 7), np.nan, np.float32)
        owner = np.repeat(np.arange(len(self.landmark)), self.count)
        first = np.cumsum(self.count) - self.count
        padded[owner, np.arange(len(flat)) - first[owner]] = flat
        return padded

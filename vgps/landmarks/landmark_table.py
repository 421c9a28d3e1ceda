"""Landmarks and their views as arrays in memory, read from the database cell by cell."""

from collections.abc import Sequence

import numpy as np

from vgps.landmarks.cells import concatenated_ranges
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.schema import CELL_COLUMNS, decode_cell
from vgps.model import FloatArray, IntArray


class LandmarkTable:
    """Landmarks and views in file order; rows of cells that have not been read hold garbage.

    Attributes:
        landmark: (L,) ids.
        numbers: (L, 5) position, sigma_px, position_sigma_m.
        first, count: (L,) first view and number of views of each landmark.
        mean_direction: (L, 3) unit vectors, mean direction to the cameras that saw the landmark.
        spread_rad: (L,) largest angle between the mean and one of these directions.
        octaves: (L, 2) least and greatest log2 of the pixel sizes of the views.
        view_numbers: (V, 9) world_p_camera, world_v_column, world_v_row.
        view_geometry: (L, 7, W) per view of a landmark, W the largest number of views: direction to its
            camera (3), normal (3), log2 of its pixel size; NaN beyond the landmark's views.
    """

    def __init__(self, file: DatabaseFile) -> None:
        self._file, meta = file, file.meta
        # np.empty: pages that are never touched cost no memory
        self.landmark = np.empty(meta.landmarks, np.int64)
        self.numbers = np.empty((meta.landmarks, 5))
        self.first, self.count = np.empty(meta.landmarks, np.int64), np.empty(meta.landmarks, np.int64)
        self.mean_direction = np.empty((meta.landmarks, 3), np.float32)
        self.spread_rad = np.empty(meta.landmarks, np.float32)
        self.octaves = np.empty((meta.landmarks, 2), np.float32)
        self.view_numbers = np.empty((meta.views, 9))
        self.view_geometry = np.empty((meta.landmarks, 7, meta.max_views), np.float32)
        self._span_of_cell: dict[int, tuple[int, int]] = {}

    def rows(self, cells: Sequence[int]) -> IntArray:
        """Return the rows of the landmarks of cells, reading those cells that are not yet in memory.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        new = [cell for cell in cells if cell not in self._span_of_cell]
        if new:
            self._derive(np.concatenate([self._read(cell) for cell in new]))
        spans = np.array([self._span_of_cell[cell] for cell in cells], np.int64).reshape(-1, 2)
        return concatenated_ranges(spans[:, 0], spans[:, 1])

    def _read(self, cell_id: int) -> IntArray:
        records = self._file.rows(
            f"SELECT first_landmark, first_view, {CELL_COLUMNS} FROM cell WHERE id = ?", (cell_id,)
        )
        try:
            ((first_landmark, first_view, *values),) = records
            cell = decode_cell(*values)
            rows = slice(first_landmark, first_landmark + len(cell.landmark))
            last_view = first_view + len(cell.view_numbers)
            if first_landmark < 0 or first_view < 0 or rows.stop > len(self.landmark):
                raise ValueError("rows beyond the table")
            if last_view > len(self.view_numbers) or cell.count.max() > self.view_geometry.shape[2]:
                raise ValueError("views beyond the table")
            self.landmark[rows] = cell.landmark
            self.numbers[rows] = cell.numbers
            self.count[rows] = cell.count
            self.first[rows] = first_view + np.cumsum(cell.count) - cell.count
            self.view_numbers[first_view:last_view] = cell.view_numbers
        except (TypeError, ValueError) as error:
            raise self._file.damaged(f"cell {cell_id}") from error
        self._span_of_cell[cell_id] = first_landmark, len(cell.landmark)
        return np.arange(rows.start, rows.stop)

    def _derive(self, rows: IntArray) -> None:
        """Fill the derived columns of landmarks that were just read."""
        count = self.count[rows]
        views = concatenated_ranges(self.first[rows], count)
        number = concatenated_ranges(np.zeros_like(count), count)
        begin = np.cumsum(count) - count
        point = np.repeat(self.numbers[rows, :3], count, axis=0)
        camera, column, row = np.split(self.view_numbers[views], 3, axis=1)
        direction, _ = _unit(camera - point)
        normal, area = _unit(-np.cross(column, row))
        octave = np.log2(area) / 2
        self.view_geometry[rows] = np.nan
        self.view_geometry[np.repeat(rows, count), :, number] = np.hstack([direction, normal, octave])
        mean, _ = _unit(np.add.reduceat(direction, begin))
        cosine = np.einsum("ij,ij->i", direction, np.repeat(mean, count, axis=0))
        self.mean_direction[rows] = mean
        self.spread_rad[rows] = np.arccos(np.clip(np.minimum.reduceat(cosine, begin), -1, 1))
        self.octaves[rows] = np.hstack(
            [reduce.reduceat(octave, begin) for reduce in (np.minimum, np.maximum)]
        )


def _unit(vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (N, 3) and lengths (N, 1); (1, 0, 0) for a vector of length zero."""
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    safe = np.where(length > 0, vectors, (1.0, 0.0, 0.0))
    return safe / np.where(length > 0, length, 1.0), length

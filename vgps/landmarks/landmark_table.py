"""What is known of landmarks and views, in memory from when it is first needed; templates read last."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vgps.landmarks.cells import concatenated_ranges
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.schema import CELL_COLUMNS, check_sum, decode_cell
from vgps.model import FloatArray, IntArray

Templates = npt.NDArray[np.uint8]
_AT_ONCE = 256  # landmarks whose templates are asked for at once


class LandmarkTable:
    """Landmarks and views in the order of the file; those of cells that were asked for are filled in.

    Attributes:
        landmark: (L,) ids.
        numbers: (L, 5) position, sigma_px, position_sigma_m.
        first, count: (L,) the views of each landmark.
        mean_direction: (L, 3) unit, to the places from which it was seen.
        spread_rad: (L,) the largest angle from there to one of them.
        octaves: (L, 2) least and greatest log2 of the pixel sizes of its views.
        view_numbers: (V, 9) world_p_camera, world_v_column, world_v_row.
        view_geometry: (L, 7, W) of each landmark's views, W the most that one has: direction to its camera
            (3), normal (3), log2 of its pixel size; NaN where there is no view.
    """

    def __init__(self, file: DatabaseFile) -> None:
        self._file, meta = file, file.meta
        # memory that is not touched is not taken
        self.landmark = np.empty(meta.landmarks, np.int64)
        self.numbers = np.empty((meta.landmarks, 5))
        self.first, self.count = np.empty(meta.landmarks, np.int64), np.empty(meta.landmarks, np.int64)
        self.mean_direction = np.empty((meta.landmarks, 3), np.float32)
        self.spread_rad = np.empty(meta.landmarks, np.float32)
        self.octaves = np.empty((meta.landmarks, 2), np.float32)
        self.view_numbers = np.empty((meta.views, 9))
        self.view_geometry = np.empty((meta.landmarks, 7, meta.max_views), np.float32)
        self._rows: dict[int, tuple[int, int]] = {}

    def rows(self, keys: Sequence[int]) -> IntArray:
        """Rows of the landmarks of cells, read from the file if they have not been.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        new = [key for key in keys if key not in self._rows]
        if new:
            self._derive(np.concatenate([self._read(key) for key in new]))
        spans = np.array([self._rows[key] for key in keys], np.int64).reshape(-1, 2)
        return concatenated_ranges(spans[:, 0], spans[:, 1])

    def _read(self, key: int) -> IntArray:
        found = self._file.rows(
            f"SELECT first_landmark, first_view, {CELL_COLUMNS} FROM cell WHERE id = ?", (key,)
        )
        try:
            ((first_landmark, first_view, *values),) = found
            cell = decode_cell(*values)
            rows = slice(first_landmark, first_landmark + len(cell.landmark))
            self.landmark[rows], self.numbers[rows], self.count[rows] = (
                cell.landmark,
                cell.numbers,
                cell.count,
            )
            self.first[rows] = first_view + np.cumsum(cell.count) - cell.count
            self.view_numbers[first_view : first_view + len(cell.view_numbers)] = cell.view_numbers
        except (TypeError, ValueError) as error:
            raise self._file.damaged(f"cell {key}") from error
        self._rows[key] = first_landmark, len(cell.landmark)
        return np.arange(rows.start, rows.stop)

    def _derive(self, rows: IntArray) -> None:
        """What selection asks, of landmarks that were just read."""
        count = self.count[rows]
        views, number = (
            concatenated_ranges(self.first[rows], count),
            concatenated_ranges(np.zeros_like(count), count),
        )
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
    """Unit vectors (N, 3) and lengths (N, 1); any unit vector for one without length."""
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    safe = np.where(length > 0, vectors, (1.0, 0.0, 0.0))
    return safe / np.where(length > 0, length, 1.0), length


class TemplateCache:
    """Templates of landmarks, one array for all; once it takes ``cache_mb``, those read longest ago go."""

    def __init__(self, file: DatabaseFile, cache_mb: int) -> None:
        self._file, meta = file, file.meta
        self._shape = meta.max_views, meta.levels, meta.patch_px, meta.patch_px
        slots = min(max(cache_mb * 2**20 // math.prod(self._shape), 1), meta.landmarks)
        self._at_once = min(_AT_ONCE, slots)
        # memory that is not touched is not taken
        self._pixels = np.empty((slots, *self._shape), np.uint8)
        self._owner = np.full(slots, -1)
        self._slot = np.full(meta.landmarks, -1)
        self._next = 0

    def take(self, rows: IntArray, views: IntArray) -> Templates:
        """(N, levels, P, P) templates of landmarks in rows (N,), of each the view (N,) by its number.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        slot = self._slot[rows]
        out = np.asarray(self._pixels[slot, views])  # rubbish where there is no slot yet
        missing = np.flatnonzero(slot < 0)
        for begin in range(0, len(missing), self._at_once):
            some = missing[begin : begin + self._at_once]
            found, pixels = self._read(rows[some])
            out[some] = pixels[np.searchsorted(found, rows[some]), views[some]]
            self._keep(found, pixels)
        return out

    def _keep(self, rows: IntArray, pixels: Templates) -> None:
        """Put templates (n, W, levels, P, P) in the place of those read longest ago."""
        slot = (self._next + np.arange(len(rows))) % len(self._owner)
        self._next += len(rows)
        gone = self._owner[slot]
        self._slot[gone[gone >= 0]] = -1
        self._pixels[slot], self._owner[slot], self._slot[rows] = pixels, rows, slot

    def _read(self, rows: IntArray) -> tuple[IntArray, Templates]:
        """The rows sorted, each once, and their templates (n, W, levels, P, P), W the most views of one."""
        wanted = sorted(set(rows.tolist()))
        marks = ",".join("?" * len(wanted))
        found = self._file.rows(
            f"SELECT id, pixels, check_sum FROM template WHERE id IN ({marks}) ORDER BY id", wanted
        )
        of_landmark = math.prod(self._shape)
        try:
            for row, (key, pixels, crc) in zip(wanted, found, strict=True):
                if key != row or check_sum(pixels) != crc:
                    raise ValueError("check sum")
            raw = b"".join([pixels.ljust(of_landmark, b"\0") for _, pixels, _ in found])
            return np.array(wanted), np.frombuffer(raw, np.uint8).reshape(-1, *self._shape)
        except (TypeError, ValueError) as error:
            raise self._file.damaged(f"templates of landmarks {wanted[0]} to {wanted[-1]}") from error

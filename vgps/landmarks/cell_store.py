"""Cells of a landmark database, read when they are needed and kept while there is room."""

from collections import OrderedDict

import numpy as np
import numpy.typing as npt

from vgps.landmarks.cells import Cell
from vgps.landmarks.opening import DatabaseFile
from vgps.landmarks.schema import CELL_COLUMNS, check_sum, decode_cell

Templates = npt.NDArray[np.uint8]


class LoadedCell:
    """A cell in memory, with what selection asks of it; its templates from when they are first needed."""

    def __init__(self, cell: Cell, max_views: int) -> None:
        self.cell, self.first = cell, np.cumsum(cell.count) - cell.count
        self.looks = cell.looks(max_views)
        self.templates: Templates | None = None

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        arrays = (self.cell.numbers, self.cell.view_numbers, self.looks, self.templates)
        return sum(array.nbytes for array in arrays if array is not None)


class CellStore:
    """The cells of a file; what was used longest ago goes once the rest takes more than ``cache_mb``."""

    def __init__(self, file: DatabaseFile, cache_mb: int) -> None:
        self._file, self._limit = file, cache_mb * 2**20
        self._kept: OrderedDict[int, LoadedCell] = OrderedDict()
        self._bytes = 0

    def cell(self, key: int) -> LoadedCell:
        """A cell by its id.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        loaded = self._kept.get(key)
        if loaded is None:
            loaded = self._read(key)
            self._keep(key, loaded, loaded.nbytes)
        self._kept.move_to_end(key)
        return loaded

    def templates(self, key: int) -> Templates:
        """(m, levels, P, P) templates of a cell's views.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        loaded = self.cell(key)
        if loaded.templates is None:
            loaded.templates = self._read_templates(key, len(loaded.cell.view_numbers))
            self._keep(key, loaded, loaded.templates.nbytes)
        return loaded.templates

    def _read(self, key: int) -> LoadedCell:
        rows = self._file.rows(f"SELECT {CELL_COLUMNS} FROM cell WHERE id = ?", (key,))
        try:
            (row,) = rows
            return LoadedCell(decode_cell(*row), self._file.meta.max_views)
        except (TypeError, ValueError, IndexError) as error:
            raise self._file.damaged(f"cell {key}") from error

    def _read_templates(self, key: int, count: int) -> Templates:
        meta = self._file.meta
        rows = self._file.rows("SELECT templates, templates_check_sum FROM cell WHERE id = ?", (key,))
        try:
            ((blob, crc),) = rows
            if check_sum(blob) != crc:
                raise ValueError("check sum")
            flat = np.frombuffer(blob, np.uint8)
            return flat.reshape(count, meta.levels, meta.patch_px, meta.patch_px)
        except (TypeError, ValueError) as error:
            raise self._file.damaged(f"templates of cell {key}") from error

    def _keep(self, key: int, loaded: LoadedCell, more: int) -> None:
        self._kept[key] = loaded
        self._bytes += more
        while self._bytes > self._limit and len(self._kept) > 1:
            _, old = self._kept.popitem(last=False)
            self._bytes -= old.nbytes

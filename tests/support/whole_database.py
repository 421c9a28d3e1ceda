"""Every view of a database file, read back for comparison with what was written."""

from pathlib import Path

import numpy as np

from vgps.landmarks.cells import concatenated_ranges
from vgps.landmarks.database import gather_views
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.landmark_table import LandmarkTable
from vgps.landmarks.model import LandmarkViews
from vgps.landmarks.template_cache import TemplateCache


def all_views(path: Path, cache_mb: int = 256) -> LandmarkViews:
    """Return every view of every landmark, sorted by landmark."""
    file = DatabaseFile(path)
    try:
        table = LandmarkTable(file)
        rows = table.rows([cell for (cell,) in file.rows("SELECT id FROM cell_box ORDER BY id")])
        rows = rows[np.argsort(table.landmark[rows], kind="stable")]
        count = table.count[rows]
        views = concatenated_ranges(np.zeros_like(count), count)
        return gather_views(table, TemplateCache(file, cache_mb), np.repeat(rows, count), views)
    finally:
        file.close()

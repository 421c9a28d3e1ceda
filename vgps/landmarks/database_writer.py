"""Writing of a landmark database, complete or not at all."""

import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.cells import Cell, concatenated_ranges, partition, pixel_sizes_m
from vgps.landmarks.model import DatabaseContents, LandmarkViews
from vgps.landmarks.schema import (
    APPLICATION_ID,
    TABLES,
    VERSION,
    check_sum,
    digest,
    encode_cell,
    encode_keyframe,
    encode_source,
)
from vgps.model import IntArray
from vgps.writers.atomic import new_file

Templates = npt.NDArray[np.uint8]

_CELL_SIZE = 64  # landmarks: small cells read less that is not needed, large ones take fewer queries


def write_database(contents: DatabaseContents, out: Path) -> None:
    """Write a landmark database; the file gets its name once complete. Equal contents give equal bytes.

    Args:
        contents: What to write.
        out: The file.

    Raises:
        LandmarkDatabaseError: There are no landmarks, or the disk cannot be written.
        RunFolderError: ``out`` is a folder or cannot be written.
    """
    if not len(contents.views):
        raise LandmarkDatabaseError("has no landmarks to write", file=out)
    with new_file(out) as file:
        connection = sqlite3.connect(file, isolation_level=None)
        try:
            _fill(connection, contents)
        except sqlite3.OperationalError as error:
            raise LandmarkDatabaseError(f"cannot be written ({error})", file=out) from error
        finally:
            connection.close()


def _fill(connection: sqlite3.Connection, contents: DatabaseContents) -> None:
    # the file does not yet have its final name, so a journal would protect nothing
    connection.executescript("PRAGMA page_size=16384; PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;")
    connection.executescript(f"PRAGMA application_id={APPLICATION_ID}; PRAGMA user_version={VERSION};")
    connection.executescript(TABLES)
    connection.execute("BEGIN")
    landmarks, views = 0, 0
    for number, (cell, templates, box) in enumerate(_cells(contents.views), start=1):
        _insert(connection, "cell", (number, landmarks, views, *encode_cell(cell)))
        _insert(connection, "cell_box", (number, *box))
        for row, pixels in enumerate(np.split(templates, np.cumsum(cell.count)[:-1]), start=landmarks):
            raw = pixels.tobytes()
            _insert(connection, "template", (row, check_sum(raw), raw))
        landmarks, views = landmarks + len(cell.landmark), views + len(templates)
    for number, source in enumerate(contents.sources, start=1):
        _insert(connection, "source", (number, *encode_source(source)))
    for number, keyframe in enumerate(contents.keyframes, start=1):
        _insert(connection, "keyframe", (number, *encode_keyframe(keyframe)))
    _insert(connection, "meta", (*_meta(contents), ""))
    connection.execute("UPDATE meta SET digest = ?", (digest(connection),))
    connection.execute("COMMIT")


def _insert(connection: sqlite3.Connection, table: str, values: tuple[Any, ...]) -> None:
    connection.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(values))})", values)


def _meta(contents: DatabaseContents) -> tuple[float | int | None, ...]:
    origin = contents.world_origin or (None, None, None)
    views = contents.views
    count = np.unique(views.landmark, return_counts=True)[1]
    levels, patch_px = views.templates.shape[1:3]
    pixel_m = pixel_sizes_m(views)
    sizes = float(pixel_m.min()), float(pixel_m.max())
    return (*origin, patch_px, levels, int(count.max()), len(count), len(views), *sizes)


def _cells(views: LandmarkViews) -> Iterator[tuple[Cell, Templates, tuple[float, ...]]]:
    """Yield each cell with the templates of its views and its box."""
    order = np.argsort(views.landmark, kind="stable")
    landmark, first, count = np.unique(views.landmark[order], return_index=True, return_counts=True)
    pixel_m = pixel_sizes_m(views)[order]
    octave = np.round(np.log2(np.maximum.reduceat(pixel_m, first))).astype(np.int64)
    for rows in partition(views.world_p_landmark[order[first]], octave, _CELL_SIZE):
        of_cell = concatenated_ranges(first[rows], count[rows])
        cell = _cell(views, landmark[rows], order[first[rows]], count[rows], order[of_cell])
        point, pixels = cell.numbers[:, :3], pixel_m[of_cell]
        sides = np.column_stack([point.min(axis=0), point.max(axis=0)]).ravel().tolist()
        yield cell, views.templates[order[of_cell]], (*sides, float(pixels.min()), float(pixels.max()))


def _cell(views: LandmarkViews, landmark: IntArray, first: IntArray, count: IntArray, rows: IntArray) -> Cell:
    """Return a cell from the first view of each landmark, and the rows of all its views."""
    numbers = [
        views.world_p_landmark[first],
        views.sigma_px[first, None],
        views.position_sigma_m[first, None],
    ]
    view_numbers = [views.world_p_camera[rows], views.world_v_column[rows], views.world_v_row[rows]]
    return Cell(landmark, np.hstack(numbers), count, np.hstack(view_numbers))

"""Schema of the landmark database: SQLite with an R*Tree over cells of landmarks.

Tables: ``meta`` (one row), ``source`` (a row per run), ``cell`` (landmarks and views as little-endian
arrays, numbered through all cells from 0), ``cell_box`` (R*Tree over east, north, up and the metres that a
template pixel covers), ``template`` (a row per landmark), ``keyframe``. The R*Tree stores float32 and rounds
boxes outwards, so a box never loses a landmark; the arrays are float64.
"""

import hashlib
import sqlite3
import zlib
from functools import cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from vgps.landmarks.cells import Cell
from vgps.landmarks.model import Cameras, Keyframe, Source

APPLICATION_ID = 0x76677073  # "vgps"
VERSION = 1  # of the schema, in user_version; early files lack the columns of _EARLY

TABLES = """
CREATE TABLE meta (
    latitude_deg REAL, longitude_deg REAL, height_m REAL,
    patch_px INTEGER NOT NULL, levels INTEGER NOT NULL, max_views INTEGER NOT NULL,
    landmarks INTEGER NOT NULL, views INTEGER NOT NULL, finest_m REAL NOT NULL, coarsest_m REAL NOT NULL,
    digest TEXT NOT NULL
);
CREATE TABLE source (
    id INTEGER PRIMARY KEY, recording TEXT, frames TEXT, landmarks INTEGER, settings TEXT,
    cameras TEXT, check_sum INTEGER
);
CREATE TABLE cell (
    id INTEGER PRIMARY KEY, first_landmark INTEGER, first_view INTEGER,
    landmark BLOB, numbers BLOB, views BLOB, view_numbers BLOB, check_sum INTEGER
);
CREATE VIRTUAL TABLE cell_box USING rtree(
    id, east_0, east_1, north_0, north_1, up_0, up_1, pixel_0, pixel_1
);
CREATE TABLE template (id INTEGER PRIMARY KEY, check_sum INTEGER, pixels BLOB);
CREATE TABLE keyframe (
    id INTEGER PRIMARY KEY, world_T_camera BLOB, landmark BLOB, points BLOB, descriptors BLOB,
    width INTEGER, height INTEGER, thumbnail BLOB, check_sum INTEGER
);
"""
CELL_COLUMNS = "landmark, numbers, views, view_numbers, check_sum"
SOURCE_COLUMNS = "recording, frames, landmarks, settings"
KEYFRAME_COLUMNS = "world_T_camera, landmark, points, descriptors, width, height, thumbnail"

_CAMERAS = TypeAdapter(Cameras)
META_COLUMNS = (
    "latitude_deg, longitude_deg, height_m, patch_px, levels, max_views, landmarks, views, "
    "finest_m, coarsest_m"
)

_DIGESTED = {
    "meta": f"SELECT {META_COLUMNS} FROM meta",
    "source": "SELECT * FROM source ORDER BY id",
    "cell": "SELECT * FROM cell ORDER BY id",
    "cell_box": "SELECT * FROM cell_box ORDER BY id",
    "template": "SELECT * FROM template ORDER BY id",
    "keyframe": "SELECT * FROM keyframe ORDER BY id",
}


_EARLY = {  # absent in early files
    ("table", "keyframe", "check_sum"),
    ("table", "source", "cameras"),
    ("table", "source", "check_sum"),
}


def foreign_part(connection: sqlite3.Connection) -> str | None:
    """Return the name of what a database has beside the schema, or lacks of it; None if it has the schema.

    A view or trigger could make a query run for ever, and a table of another module could open other files.
    """
    found, expected = _objects(connection), _expected_objects()
    differing = sorted((found - expected) | (expected - found - _EARLY))
    return " ".join(differing[0]) if differing else None


@cache
def _expected_objects() -> frozenset[tuple[str, ...]]:
    connection = sqlite3.connect(":memory:")
    try:
        connection.executescript(TABLES)
        return _objects(connection)
    finally:
        connection.close()


def _objects(connection: sqlite3.Connection) -> frozenset[tuple[str, ...]]:
    """Return type and name of every object, and of every column of a plain table."""
    found: set[tuple[str, ...]] = set()
    for row in connection.execute("SELECT type, name, sql FROM sqlite_master").fetchall():
        kind, name, sql = map(str, row)  # damage makes bytes of text
        found.add((kind, name))
        if sql.startswith("CREATE VIRTUAL"):
            found.add((kind, " ".join(sql.split())))
        elif kind == "table":
            columns = connection.execute("SELECT name, hidden FROM pragma_table_xinfo(?)", (name,))
            found |= {
                (kind, name, column if not hidden else f"hidden {column}") for column, hidden in columns
            }
    return frozenset(found)


def digest(connection: sqlite3.Connection) -> str:
    """Return the SHA-256 of every value of every table except the digest itself."""
    sha = hashlib.sha256()
    for table, query in _DIGESTED.items():
        sha.update(table.encode())
        for row in connection.execute(query):
            for value in row:
                raw = value if isinstance(value, bytes) else repr(value).encode()
                sha.update(len(raw).to_bytes(8, "little"))
                sha.update(raw)
    return sha.hexdigest()


def check_sum(*parts: bytes) -> int:
    """Return the CRC-32 of blobs, concatenated."""
    crc = 0
    for part in parts:
        crc = zlib.crc32(part, crc)
    return crc


def encode_source(source: Source) -> tuple[str | int | None, ...]:
    """Return the values of :data:`SOURCE_COLUMNS`, and the cameras as JSON with their check sum."""
    columns = source.recording, source.frames, source.landmarks, source.settings
    if source.cameras is None:
        return (*columns, None, None)
    cameras = _CAMERAS.dump_json(source.cameras)
    return (*columns, cameras.decode(), check_sum(cameras))


def decode_source(record: tuple[Any, ...]) -> Source:
    """Return the source encoded in a record; its cameras are None in early databases.

    Raises:
        ValueError: The cameras are not what was written.
    """
    recording, frames, landmarks, settings, cameras, crc = record
    if cameras is not None and check_sum(cameras.encode()) != crc:
        raise ValueError("check sum")
    found = None if cameras is None else _CAMERAS.validate_json(cameras)
    return Source(recording, frames, landmarks, settings, found)


def encode_cell(cell: Cell) -> tuple[bytes | int, ...]:
    """Return the values of :data:`CELL_COLUMNS`."""
    blobs = (
        cell.landmark.astype("<i8").tobytes(),
        cell.numbers.astype("<f8").tobytes(),
        cell.count.astype("<i8").tobytes(),
        cell.view_numbers.astype("<f8").tobytes(),
    )
    return (*blobs, check_sum(*blobs))


def decode_cell(landmark: bytes, numbers: bytes, views: bytes, view_numbers: bytes, crc: int) -> Cell:
    """Return the cell encoded in the values of :data:`CELL_COLUMNS`.

    Raises:
        ValueError: The blobs differ from what was written.
    """
    if check_sum(landmark, numbers, views, view_numbers) != crc:
        raise ValueError("check sum")
    cell = Cell(
        np.frombuffer(landmark, "<i8"),
        np.frombuffer(numbers, "<f8").reshape(-1, 5),
        np.frombuffer(views, "<i8"),
        np.frombuffer(view_numbers, "<f8").reshape(-1, 9),
    )
    if not len(cell.landmark) == len(cell.numbers) == len(cell.count) > 0 or cell.count.min() < 1:
        raise ValueError("numbers of landmarks and views")
    if int(cell.count.max()) > len(cell.view_numbers) or int(cell.count.sum()) != len(cell.view_numbers):
        raise ValueError("numbers of landmarks and views")
    if not (np.isfinite(cell.numbers[:, :3]).all() and np.isfinite(cell.view_numbers).all()):
        raise ValueError("positions that are not finite")
    return cell


def encode_keyframe(keyframe: Keyframe) -> tuple[bytes | int, ...]:
    """Return the values of :data:`KEYFRAME_COLUMNS`, and their check sum."""
    height, width = keyframe.thumbnail.shape
    blobs = (
        keyframe.world_T_camera.astype("<f8").tobytes(),
        keyframe.landmark.astype("<i8").tobytes(),
        keyframe.world_p_landmark.astype("<f8").tobytes(),
        keyframe.descriptors.tobytes(),
    )
    thumbnail = keyframe.thumbnail.tobytes()
    return (*blobs, width, height, thumbnail, check_sum(*blobs, thumbnail))


def decode_keyframe(record: tuple[Any, ...]) -> Keyframe:
    """Return the keyframe encoded in a record.

    Args:
        record: Values of :data:`KEYFRAME_COLUMNS` and the check sum; it is None in early databases, of which
            only the sizes are checked.

    Raises:
        ValueError: The blobs differ from what was written, or do not fit each other.
    """
    pose, landmark, points, descriptors, width, height, thumbnail, crc = record
    if crc is not None and check_sum(pose, landmark, points, descriptors, thumbnail) != crc:
        raise ValueError("check sum")
    ids = np.frombuffer(landmark, "<i8")
    world_p = np.frombuffer(points, "<f8").reshape(len(ids), 3)
    rows = np.frombuffer(descriptors, np.uint8).reshape(len(ids), -1 if len(ids) else 0)
    return Keyframe(
        world_T_camera=np.frombuffer(pose, "<f8").reshape(4, 4),
        landmark=ids,
        world_p_landmark=world_p,
        descriptors=rows,
        thumbnail=np.frombuffer(thumbnail, np.uint8).reshape(height, width),
    )

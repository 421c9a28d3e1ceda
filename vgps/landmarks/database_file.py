"""The SQLite file of a landmark database: opening, checks and queries, with every fault in one line."""

import math
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.schema import APPLICATION_ID, META_COLUMNS, VERSION, digest, foreign_part
from vgps.model import GeodeticPoint

_LANDMARK_BYTES, _VIEW_BYTES = 56, 72  # of the arrays in table cell, which are not compressed
_MAGIC = b"SQLite format 3\0"
_EXPECTED = "a landmark database written by vgps landmarks build"
_REMEDY = "rebuild it with vgps landmarks build"


@dataclass(frozen=True, kw_only=True)
class Meta:
    """The row of table ``meta``.

    Attributes:
        world_origin: Origin of the ENU frame; None where control points alone define the world.
        patch_px, levels: Side of the templates, and number of their scales.
        max_views: Largest number of views of a landmark.
        landmarks, views: Their numbers.
        pixel_m: Least and greatest metres that a template pixel covers.
        digest: SHA-256 of the contents.
    """

    world_origin: GeodeticPoint | None
    patch_px: int
    levels: int
    max_views: int
    landmarks: int
    views: int
    pixel_m: tuple[float, float]
    digest: str


class DatabaseFile:
    """A landmark database, recognised and open for reading.

    Attributes:
        path: The file.
        schema_version: Of the file.
        meta: What the file says about itself.

    Raises:
        LandmarkDatabaseError: The file is absent, empty, truncated, damaged, not a landmark database, or
            newer than this program; also raised by every query that meets damage.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        _check_header(path)
        # immutable: the file is only ever replaced as a whole, so neither locks nor a journal are needed
        self._connection = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1", uri=True)
        self._connection.text_factory = lambda raw: raw.decode("utf-8", "replace")
        try:
            self.schema_version = self._check_kind()
            self._check_schema()
            self.meta = self._read_meta()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def rows(self, query: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """Return all rows of a query."""
        try:
            return self._connection.execute(query, values).fetchall()
        except sqlite3.ProgrammingError:
            raise
        except sqlite3.DatabaseError as error:
            raise self.damaged(str(error)) from error

    def damaged(self, what: str) -> LandmarkDatabaseError:
        """Return the error to raise where the contents differ from what was written."""
        try:
            found = str(self._connection.execute("PRAGMA quick_check(1)").fetchone()[0])
        except (sqlite3.DatabaseError, TypeError, UnicodeDecodeError) as error:
            found = str(error)
        why = what if found in {"ok", what} else f"{what}: {found}"
        return LandmarkDatabaseError(f"is damaged ({why})", file=self.path, remedy=_REMEDY)

    def verify(self) -> str:
        """Check the whole file and return the digest of its contents.

        Raises:
            LandmarkDatabaseError: SQLite finds damage, or the contents differ from what was written.
        """
        found = str(self.rows("PRAGMA quick_check(1)")[0][0])
        if found != "ok":
            raise self.damaged(found)
        try:
            now = digest(self._connection)
        except sqlite3.DatabaseError as error:
            raise self.damaged(str(error)) from error
        if now != self.meta.digest:
            raise self.damaged("contents differ from what was written")
        return now

    def _check_kind(self) -> int:
        """Return the schema version."""
        application, version = (
            int(self.rows(f"PRAGMA {name}")[0][0]) for name in ("application_id", "user_version")
        )
        if application != APPLICATION_ID:
            raise LandmarkDatabaseError(
                "is an SQLite database of another program", file=self.path, expected=_EXPECTED
            )
        if version != VERSION:
            raise LandmarkDatabaseError(
                f"has schema version {version}",
                file=self.path,
                expected=f"version {VERSION}",
                remedy="update vgps, or rebuild the database" if version > VERSION else _REMEDY,
            )
        return version

    def _check_schema(self) -> None:
        try:
            foreign = foreign_part(self._connection)
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            raise self.damaged(str(error)) from error
        if foreign is not None:
            raise self.damaged(f"{foreign} is not as in the schema")

    def _read_meta(self) -> Meta:
        records = self.rows(f"SELECT {META_COLUMNS}, digest FROM meta")
        if len(records) != 1:
            raise self.damaged(f"table meta has {len(records)} rows instead of 1")
        *origin, patch_px, levels, max_views, landmarks, views, finest_m, coarsest_m, written = records[0]
        meta = Meta(
            world_origin=None if None in origin else GeodeticPoint(*origin),
            patch_px=patch_px,
            levels=levels,
            max_views=max_views,
            landmarks=landmarks,
            views=views,
            pixel_m=(finest_m, coarsest_m),
            digest=written,
        )
        if not _is_possible(meta, self.path.stat().st_size):
            raise self.damaged("impossible numbers in table meta")
        return meta


def _is_possible(meta: Meta, file_bytes: int) -> bool:
    """Whether numbers are of their types, and the file is large enough for what it says to hold."""
    counts = meta.patch_px, meta.levels, meta.max_views, meta.landmarks, meta.views
    numbers = *meta.pixel_m, *(meta.world_origin or ())
    if not all(isinstance(count, int) and count > 0 for count in counts):
        return False
    if not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return False
    if not meta.landmarks <= meta.views or not meta.max_views <= meta.views or meta.pixel_m[0] <= 0:
        return False
    view_bytes = _VIEW_BYTES + meta.levels * meta.patch_px**2
    return meta.landmarks * _LANDMARK_BYTES + meta.views * view_bytes <= file_bytes


def _check_header(path: Path) -> None:
    """Raise an error where SQLite's own message would be unclear: absent, empty, foreign or truncated."""
    try:
        with path.open("rb") as stream:
            head = stream.read(100)
        size = path.stat().st_size
    except FileNotFoundError as error:
        raise LandmarkDatabaseError("no such file", file=path, expected=_EXPECTED) from error
    except OSError as error:
        raise LandmarkDatabaseError(
            f"cannot be read ({error.strerror})", file=path, expected=_EXPECTED
        ) from error
    if not head:
        raise LandmarkDatabaseError("is empty", file=path, expected=_EXPECTED, remedy=_REMEDY)
    if not head.startswith(_MAGIC):
        raise LandmarkDatabaseError("is not an SQLite database", file=path, expected=_EXPECTED)
    page, pages = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
    complete = (65536 if page == 1 else page) * pages
    if size < max(complete, 100):
        raise LandmarkDatabaseError(
            f"is truncated to {size} bytes", file=path, expected=f"{complete} bytes", remedy=_REMEDY
        )

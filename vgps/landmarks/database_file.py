"""A landmark database's file: opened, recognised, asked; whatever is wrong with it said in one line."""

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.schema import APPLICATION_ID, META_COLUMNS, VERSION, digest
from vgps.model import GeodeticPoint

_MAGIC = b"SQLite format 3\0"
_EXPECTED = "a landmark database, as vgps landmarks build writes it"
_REMEDY = "build it again with vgps landmarks build"


@dataclass(frozen=True)
class Meta:
    """The one row of ``meta``, and the least and greatest metres that a template's pixel covers."""

    world_origin: GeodeticPoint | None
    patch_px: int
    levels: int
    max_views: int
    landmarks: int
    views: int
    pixel_m: tuple[float, float]
    digest: str


class DatabaseFile:
    """A file that is known to be a landmark database, open for reading.

    Raises:
        LandmarkDatabaseError: The file is absent, empty, cut short, damaged, of another program or newer; the
            same from every query that meets damage.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        _check_header(path)
        # immutable: the file is only ever replaced as a whole, so neither locks nor a journal are needed
        self._connection = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1", uri=True)
        try:
            self._check_kind()
            self.meta = self._read_meta()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let the file go."""
        self._connection.close()

    def rows(self, query: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """All rows that a query gives."""
        try:
            return self._connection.execute(query, values).fetchall()
        except sqlite3.ProgrammingError:
            raise
        except sqlite3.DatabaseError as error:
            raise self.damaged(str(error)) from error

    def damaged(self, what: str) -> LandmarkDatabaseError:
        """The error to raise where something is not as it was written."""
        try:
            found = str(self._connection.execute("PRAGMA quick_check(1)").fetchone()[0])
        except (sqlite3.DatabaseError, TypeError) as error:
            found = str(error)
        why = what if found in {"ok", what} else f"{what}: {found}"
        return LandmarkDatabaseError(f"is damaged ({why})", file=self.path, remedy=_REMEDY)

    def verify(self) -> str:
        """Look through the whole file; the digest of its contents.

        Raises:
            LandmarkDatabaseError: SQLite finds damage, or the contents are not what was written.
        """
        found = str(self.rows("PRAGMA quick_check(1)")[0][0])
        if found != "ok":
            raise self.damaged(found)
        try:
            now = digest(self._connection)
        except sqlite3.DatabaseError as error:
            raise self.damaged(str(error)) from error
        if now != self.meta.digest:
            raise self.damaged("its contents are not those that were written")
        return now

    def _check_kind(self) -> None:
        application, version = (
            self.rows(f"PRAGMA {name}")[0][0] for name in ("application_id", "user_version")
        )
        if application != APPLICATION_ID:
            raise LandmarkDatabaseError(
                "is an SQLite database of another program", file=self.path, expected=_EXPECTED
            )
        if version != VERSION:
            raise LandmarkDatabaseError(
                f"has version {version}",
                file=self.path,
                expected=f"version {VERSION}",
                remedy="update vgps, or build the database again" if version > VERSION else _REMEDY,
            )

    def _read_meta(self) -> Meta:
        rows = self.rows(f"SELECT {META_COLUMNS}, digest FROM meta")
        if len(rows) != 1:
            raise self.damaged("it says nothing of itself")
        *origin, patch_px, levels, max_views, landmarks, views, finest_m, coarsest_m, written = rows[0]
        known = None not in origin
        return Meta(
            GeodeticPoint(*origin) if known else None,
            patch_px,
            levels,
            max_views,
            landmarks,
            views,
            (finest_m, coarsest_m),
            written,
        )


def _check_header(path: Path) -> None:
    """What SQLite would not say clearly: no such file, an empty one, one of another kind, one cut short."""
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
        raise LandmarkDatabaseError("is no SQLite database", file=path, expected=_EXPECTED)
    page, pages = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
    whole = (65536 if page == 1 else page) * pages
    if size < max(whole, 100):
        raise LandmarkDatabaseError(
            f"is cut short: {size} bytes", file=path, expected=f"{whole} bytes", remedy=_REMEDY
        )

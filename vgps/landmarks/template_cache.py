"""A cache of the templates that were read last."""

import math

import numpy as np
import numpy.typing as npt

from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.schema import check_sum
from vgps.model import IntArray

Templates = npt.NDArray[np.uint8]
_BATCH = 256  # landmarks per query


class TemplateCache:
    """Templates by landmark, in one array of at most ``cache_mb``; the oldest entries are replaced first.

    Args:
        file: The database.
        cache_mb: Size of the cache, MB; at least one landmark's templates are kept.
    """

    def __init__(self, file: DatabaseFile, cache_mb: int) -> None:
        self._file, meta = file, file.meta
        self._shape = meta.max_views, meta.levels, meta.patch_px, meta.patch_px
        slots = min(max(cache_mb * 2**20 // math.prod(self._shape), 1), meta.landmarks)
        self._batch = min(_BATCH, slots)
        # np.empty: pages that are never touched cost no memory
        self._pixels = np.empty((slots, *self._shape), np.uint8)
        self._owner = np.full(slots, -1)
        self._slot = np.full(meta.landmarks, -1)
        self._next = 0

    def take(self, rows: IntArray, views: IntArray) -> Templates:
        """Return templates (N, levels, P, P).

        Args:
            rows: (N,) landmarks, by their row in the file.
            views: (N,) view of each, counted within its landmark.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        slot = self._slot[rows]
        out = np.asarray(self._pixels[slot, views])  # garbage where slot is -1, overwritten below
        missing = np.flatnonzero(slot < 0)
        for begin in range(0, len(missing), self._batch):
            batch = missing[begin : begin + self._batch]
            read, pixels = self._read(rows[batch])
            out[batch] = pixels[np.searchsorted(read, rows[batch]), views[batch]]
            self._keep(read, pixels)
        return out

    def _keep(self, rows: IntArray, pixels: Templates) -> None:
        """Replace the oldest entries by templates (n, W, levels, P, P)."""
        slot = (self._next + np.arange(len(rows))) % len(self._owner)
        self._next += len(rows)
        replaced = self._owner[slot]
        self._slot[replaced[replaced >= 0]] = -1
        self._pixels[slot], self._owner[slot], self._slot[rows] = pixels, rows, slot

    def _read(self, rows: IntArray) -> tuple[IntArray, Templates]:
        """Return the unique rows, sorted, and their templates (n, W, levels, P, P), W the most views."""
        unique = sorted(set(rows.tolist()))
        marks = ",".join("?" * len(unique))
        records = self._file.rows(
            f"SELECT id, pixels, check_sum FROM template WHERE id IN ({marks}) ORDER BY id", unique
        )
        landmark_bytes = math.prod(self._shape)
        try:
            for row, (key, pixels, crc) in zip(unique, records, strict=True):
                if key != row or check_sum(pixels) != crc:
                    raise ValueError("check sum")
            raw = b"".join([pixels.ljust(landmark_bytes, b"\0") for _, pixels, _ in records])
            return np.array(unique), np.frombuffer(raw, np.uint8).reshape(-1, *self._shape)
        except (TypeError, ValueError) as error:
            raise self._file.damaged(f"templates of landmarks {unique[0]} to {unique[-1]}") from error

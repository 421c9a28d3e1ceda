"""Position, reliability, luminance and evidence of motion of every feature of a map, by feature id."""

import copy

import numpy as np

from vgps.mapping.map_update import Positions, Similarity
from vgps.model import FloatArray, IntArray

_GROWTH = 4096  # rows allocated at a time


class FeatureTable:
    """One row per feature id, in memory that grows with the number of features."""

    def __init__(self) -> None:
        self._points = np.full((_GROWTH, 3), np.nan)
        self._sigma_px = np.full(_GROWTH, np.nan)
        self._gray = np.zeros(_GROWTH, dtype=np.uint8)
        self._moving_views = np.zeros(_GROWTH, dtype=np.int64)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def points(self) -> FloatArray:
        """(T, 3) positions, NaN for a feature without one."""
        return self._points[: self._count]

    @property
    def sigma_px(self) -> FloatArray:
        """(T,) reliabilities sigma_j (13), NaN for a feature without a position."""
        return self._sigma_px[: self._count]

    @property
    def gray(self) -> np.ndarray:
        """(T,) luminance of each feature in its first observation."""
        return self._gray[: self._count]

    @property
    def moving_views(self) -> IntArray:
        """(T,) number of views in which each feature fitted no static point, less those in which it did."""
        return self._moving_views[: self._count]

    def copy(self) -> "FeatureTable":
        """Return a table whose positions can change while this one grows."""
        twin = copy.copy(self)
        twin._points, twin._sigma_px = self._points.copy(), self._sigma_px.copy()
        return twin

    def add(self, gray: np.ndarray) -> IntArray:
        """Add features without positions and return their ids (n,)."""
        ids = np.arange(self._count, self._count + len(gray))
        self._count += len(gray)
        while self._count > len(self._gray):
            more = max(len(self._gray), _GROWTH)
            self._points = np.concatenate([self._points, np.full((more, 3), np.nan)])
            self._sigma_px = np.concatenate([self._sigma_px, np.full(more, np.nan)])
            self._gray = np.concatenate([self._gray, np.zeros(more, dtype=np.uint8)])
            self._moving_views = np.concatenate([self._moving_views, np.zeros(more, dtype=np.int64)])
        self._gray[ids] = gray
        return ids

    def add_copies(self, ids: IntArray) -> IntArray:
        """Add features (n,) with the rows of others (n,), and return their ids."""
        new = self.add(self._gray[ids])
        self._points[new], self._sigma_px[new] = self._points[ids], self._sigma_px[ids]
        self._moving_views[new] = self._moving_views[ids]
        return new

    def place(self, positions: Positions) -> None:
        """Set the positions of features."""
        self._points[positions.ids] = positions.points
        self._sigma_px[positions.ids] = positions.sigma_px

    def transform(self, to_world: Similarity) -> None:
        """Move all positions by a similarity."""
        self._points = to_world.points(self._points)

    def drop_first(self, count: int) -> None:
        """Discard the first features and lower the ids of the others by ``count``."""
        self._points, self._sigma_px = self._points[count:].copy(), self._sigma_px[count:].copy()
        self._gray, self._moving_views = self._gray[count:].copy(), self._moving_views[count:].copy()
        self._count -= count

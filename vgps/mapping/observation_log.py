"""Observations of all features, frame by frame, in the order in which they were made."""

from collections.abc import Callable

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solution import Observations


class ObservationLog:
    """Observations (n, 2) of features (n,), in batches of one frame each."""

    def __init__(self) -> None:
        self._batches: list[tuple[int, IntArray, FloatArray]] = []

    def copy(self) -> "ObservationLog":
        """Return a log that does not change while this one grows."""
        twin = ObservationLog()
        twin._batches = self._batches[:]
        return twin

    def append(self, frame: int, ids: IntArray, uv_px: FloatArray) -> None:
        """Append observations (n, 2) of features (n,) in a frame that is not older than the last."""
        self._batches.append((frame, ids, uv_px))

    def since(self, frame: int) -> Observations:
        """Return every observation from a frame on; ``landmark`` is the feature id."""
        batches = self._batches
        start = next((k for k in range(len(batches)) if batches[k][0] >= frame), len(batches))
        batches = batches[start:]
        if not batches:
            empty: IntArray = np.zeros(0, dtype=np.int64)
            return Observations(empty, empty, np.zeros((0, 2)))
        frames = np.concatenate([np.full(len(ids), frame) for frame, ids, _ in batches])
        ids = np.concatenate([ids for _, ids, _ in batches])
        return Observations(frames, ids, np.concatenate([uv for _, _, uv in batches]))

    def move(self, moved: Callable[[FloatArray], FloatArray]) -> None:
        """Move all observations (n, 2)."""
        self._batches = [(frame, ids, moved(uv)) for frame, ids, uv in self._batches]

    def tracks(self, ids: IntArray, frames: IntArray) -> FloatArray:
        """Return where some frames (H,), in order, show features (n,): (n, H, 2), NaN where they do not.

        Frames that there are not are negative.
        """
        out = np.full((len(ids), len(frames), 2), np.nan)
        if not len(ids) or not (frames >= 0).any():
            return out
        seen = self.since(int(frames[frames >= 0][0]))
        order = np.argsort(ids)
        row = order[np.minimum(np.searchsorted(ids, seen.landmark, sorter=order), len(ids) - 1)]
        own = ids[row] == seen.landmark
        out[row[own], np.searchsorted(frames, seen.frame[own])] = seen.uv_px[own]
        return out

    def discard_before(self, frame: int) -> None:
        """Discard the observations of earlier frames."""
        self._batches = [batch for batch in self._batches if batch[0] >= frame]

    def smallest_id(self, default: int) -> int:
        """Return the smallest feature id observed, but no larger one than ``default``."""
        return min((int(ids.min(initial=default)) for _, ids, _ in self._batches), default=default)

    def lower_ids(self, count: int) -> None:
        """Lower all feature ids, after the first ``count`` features were discarded."""
        self._batches = [(frame, ids - count, uv) for frame, ids, uv in self._batches]

"""The recording that is written to: timelines, and whole columns at once."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import rerun as rr

from vgps.model import FloatArray, IntArray

TIME, FRAME = "time", "frame"
_FRAMES_AT_ONCE = 500  # in one chunk: the viewer fetches and uploads chunk by chunk


@dataclass(frozen=True)
class Sheet:
    """A rerun stream with the run's frame times: ``t_s`` (F,), seconds since the first frame."""

    stream: rr.RecordingStream
    t_s: FloatArray

    def static(self, path: str, *parts: rr.AsComponents) -> None:
        """Log something that holds for all time."""
        self.stream.log(path, *parts, static=True)

    def from_frame(self, path: str, frame: int, *parts: rr.AsComponents) -> None:
        """Log something that holds from a frame on, until it is logged again."""
        self.stream.set_time(TIME, duration=float(self.t_s[frame]))
        self.stream.set_time(FRAME, sequence=frame)
        self.stream.log(path, *parts)
        self.stream.reset_time()

    def at_frames(self, path: str, columns: Iterable[rr.ComponentColumn]) -> None:
        """Log columns with a row for every frame."""
        self.stream.send_columns(path, self._index(np.arange(len(self.t_s))), columns)

    def series(self, path: str, values: FloatArray, t_s: FloatArray | None = None) -> None:
        """Log a number (F,) for every frame, or (N,) at other times; NaN is left out."""
        known = np.isfinite(values)
        if not known.any():
            return
        rows = np.flatnonzero(known)
        index = self._index(rows) if t_s is None else self.index_at(t_s[rows])
        self.stream.send_columns(path, index, rr.Scalars.columns(scalars=values[rows]))

    def at_times(self, path: str, t_s: FloatArray, columns: Iterable[rr.ComponentColumn]) -> None:
        """Log columns with a row for each time (N,), seconds."""
        self.stream.send_columns(path, self.index_at(t_s), columns)

    def index_at(self, t_s: FloatArray) -> list[rr.TimeColumn]:
        """Both timelines at any times (N,): the frame is the last one before."""
        frame = np.clip(np.searchsorted(self.t_s, t_s, side="right") - 1, 0, len(self.t_s) - 1)
        return [rr.TimeColumn(TIME, duration=t_s), rr.TimeColumn(FRAME, sequence=frame)]

    def _index(self, frames: IntArray) -> list[rr.TimeColumn]:
        return [rr.TimeColumn(TIME, duration=self.t_s[frames]), rr.TimeColumn(FRAME, sequence=frames)]

    def chunks(self, per_frame: IntArray) -> Iterable[tuple[list[rr.TimeColumn], slice, IntArray]]:
        """Rows that are sorted by frame, some hundred frames at a time.

        Args:
            per_frame: (F,) how many rows each frame has.

        Yields:
            The index of the frames, the slice of their rows, and the number of rows of each.
        """
        start = np.concatenate([[0], np.cumsum(per_frame)])
        for first in range(0, len(per_frame), _FRAMES_AT_ONCE):
            last = min(first + _FRAMES_AT_ONCE, len(per_frame))
            frames = np.arange(first, last)
            yield self._index(frames), slice(int(start[first]), int(start[last])), per_frame[frames]

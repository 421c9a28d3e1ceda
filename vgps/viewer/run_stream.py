"""A rerun recording with the timelines of a run."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import rerun as rr

from vgps.model import FloatArray, IntArray

TIME, FRAME = "time", "frame"
_CHUNK_FRAMES = 500  # the viewer fetches and uploads chunk by chunk


@dataclass(frozen=True)
class RunStream:
    """A rerun recording stream and the frame times (F,) of the run, seconds since the first frame."""

    recording: rr.RecordingStream
    t_s: FloatArray

    def log_static(self, path: str, *components: rr.AsComponents) -> None:
        """Log something that holds for all times."""
        self.recording.log(path, *components, static=True)

    def log_from_frame(self, path: str, frame: int, *components: rr.AsComponents) -> None:
        """Log something that holds from a frame on, until it is logged again."""
        self.recording.set_time(TIME, duration=float(self.t_s[frame]))
        self.recording.set_time(FRAME, sequence=frame)
        self.recording.log(path, *components)
        self.recording.reset_time()

    def send_frames(self, path: str, columns: Iterable[rr.ComponentColumn]) -> None:
        """Send columns with a row for every frame."""
        self.recording.send_columns(path, self._frame_index(np.arange(len(self.t_s))), columns)

    def send_times(self, path: str, t_s: FloatArray, columns: Iterable[rr.ComponentColumn]) -> None:
        """Send columns with a row for each time (N,) [s]."""
        self.recording.send_columns(path, self._time_index(t_s), columns)

    def send_series(self, path: str, values: FloatArray, t_s: FloatArray | None = None) -> None:
        """Send one number per frame (F,), or per time (N,); NaN is left out."""
        rows = np.flatnonzero(np.isfinite(values))
        if not len(rows):
            return
        index = self._frame_index(rows) if t_s is None else self._time_index(t_s[rows])
        self.recording.send_columns(path, index, rr.Scalars.columns(scalars=values[rows]))

    def send_batches(
        self, path: str, per_frame: IntArray, columns: Callable[[slice], rr.ComponentColumnList]
    ) -> None:
        """Send several instances per frame, some hundred frames at a time.

        Args:
            path: The entity.
            per_frame: (F,) number of instances in each frame.
            columns: Returns the columns of given rows of the instances, which are sorted by frame.
        """
        first_row = np.concatenate([[0], np.cumsum(per_frame)])
        for first in range(0, len(per_frame), _CHUNK_FRAMES):
            last = min(first + _CHUNK_FRAMES, len(per_frame))
            rows = slice(int(first_row[first]), int(first_row[last]))
            index = self._frame_index(np.arange(first, last))
            self.recording.send_columns(path, index, columns(rows).partition(per_frame[first:last]))

    def _frame_index(self, frames: IntArray) -> list[rr.TimeColumn]:
        return [rr.TimeColumn(TIME, duration=self.t_s[frames]), rr.TimeColumn(FRAME, sequence=frames)]

    def _time_index(self, t_s: FloatArray) -> list[rr.TimeColumn]:
        """Return both timelines at any times (N,); the frame is the last one before."""
        frame = np.clip(np.searchsorted(self.t_s, t_s, side="right") - 1, 0, len(self.t_s) - 1)
        return [rr.TimeColumn(TIME, duration=t_s), rr.TimeColumn(FRAME, sequence=frame)]

"""A recording played forward and then backward: a drive that comes back, from a real one."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vgps.errors import RecordingError
from vgps.model import FloatArray, Frame, GpsLog, IntArray, Recording
from vgps.readers.video.derived_video import DerivedVideo
from vgps.solution import Trajectory


@dataclass(frozen=True)
class ThereAndBackVideo(DerivedVideo):
    """The first ``count`` frames of a video, and if ``back`` the same backward."""

    count: int
    back: bool = True

    @property
    def times_s(self) -> FloatArray:
        """(F,) times: there as they are, and back at the same intervals."""
        there = self.video.times_s[: self.count]
        return np.concatenate([there, turned(there, there[::-1])]) if self.back else there

    def frames(self) -> Iterator[Frame]:
        """Yield the frames there and back."""
        kept, times_s = [], self.times_s
        for frame in self.video.frames():
            if frame.index >= self.count:
                break
            if self.back:
                kept.append(frame.gray)
            yield frame
        for index, gray in enumerate(reversed(kept), start=self.count):
            yield Frame(index, float(times_s[index]), gray)


def turned(there_s: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return the times on the way back at which a drive is where it was at times on the way there.

    Args:
        there_s: (F,) times of the frames there; the last frame is shown once more on the way back.
        t_s: (N,) times on the way there.
    """
    interval_s = float(np.median(np.diff(there_s)))
    return np.asarray(2 * there_s[-1] + interval_s - t_s)


def one_pass(recording: Recording, count: int) -> Recording:
    """Return the first frames of a recording, and all its fixes."""
    return replace(recording, video=ThereAndBackVideo(recording.video, count, back=False))


def there_and_back(recording: Recording, back: Recording, count: int) -> Recording:
    """Return a recording there and back.

    Args:
        recording: Gives the video, and the fixes on the way there.
        back: The same recording with another log, whose fixes are those on the way back.
        count: Frames on the way there.

    Raises:
        RecordingError: A log is missing.
    """
    if recording.gps is None or back.gps is None:
        raise RecordingError("no GPS log", file=recording.path)
    times_s = recording.video.times_s[:count]
    rows = np.flatnonzero(recording.gps.t_s < times_s[-1])
    there = _rows(recording.gps, rows, recording.gps.t_s[rows])
    rows = np.flatnonzero(back.gps.t_s < times_s[-1])[::-1]
    return replace(
        recording,
        video=ThereAndBackVideo(recording.video, count),
        gps=_joined(there, _rows(back.gps, rows, turned(times_s, back.gps.t_s[rows]))),
    )


def truth_there_and_back(truth: Trajectory, recording: Recording) -> Trajectory:
    """Return the true poses (2 count,) of the frames there and back."""
    times_s = recording.video.times_s
    poses = truth.world_T_camera[: len(times_s) // 2]
    return Trajectory(times_s, np.concatenate([poses, poses[::-1]]))


def _rows(log: GpsLog, rows: IntArray, t_s: FloatArray) -> GpsLog:
    """Return some fixes of a log at other times."""
    columns: dict[str, Any] = {name: value[rows] for name, value in _arrays(log).items()}
    fix_class = tuple(log.fix_class[row] for row in rows.tolist())
    return replace(log, **{**columns, "t_s": t_s, "fix_class": fix_class})


def _joined(one: GpsLog, other: GpsLog) -> GpsLog:
    more = _arrays(other)
    columns: dict[str, Any] = {
        name: np.concatenate([value, more[name]]) for name, value in _arrays(one).items()
    }
    return replace(one, **{**columns, "fix_class": (*one.fix_class, *other.fix_class)})


def _arrays(log: GpsLog) -> dict[str, FloatArray]:
    values = {column.name: getattr(log, column.name) for column in fields(log)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}

"""A video at other times, as one that plays faster or slower than time passes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from vgps.model import BoolArray, FloatArray, Frame, Video
from vgps.readers.video.derived_video import DerivedVideo


@dataclass(frozen=True)
class RetimedVideo(DerivedVideo):
    """A video whose frames have other times.

    Attributes:
        at_s: (F,) the times, strictly increasing.
        repeats: (F,) which frames are known to repeat the picture before them; None if none is.
    """

    at_s: FloatArray
    repeats: BoolArray | None = None

    @property
    def times_s(self) -> FloatArray:
        """(F,) times of the frames."""
        return self.at_s

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order of presentation."""
        for frame in self.video.frames():
            repeats = frame.repeats if self.repeats is None else bool(self.repeats[frame.index])
            yield replace(frame, t_s=float(self.at_s[frame.index]), repeats=repeats)


def at_speed(video: Video, speed: float) -> Video:
    """Return a time-lapse or slow motion, a second of which took so many seconds, at its right times."""
    if speed == 1.0:
        return video
    return RetimedVideo(video, video.times_s[0] + speed * (video.times_s - video.times_s[0]))

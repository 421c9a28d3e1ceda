"""Fewer frames of a recording, where all of them would show no more."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import vgps
from vgps.model import FloatArray, Frame
from vgps.readers.video.derived_video import DerivedVideo


@dataclass(frozen=True)
class _Beginning(DerivedVideo):
    count: int

    @property
    def times_s(self) -> FloatArray:
        return self.video.times_s[: self.count]

    def frames(self) -> Iterator[Frame]:
        return islice(self.video.frames(), self.count)


@dataclass(frozen=True)
class _Thinned(DerivedVideo):
    every: int

    @property
    def times_s(self) -> FloatArray:
        return self.video.times_s[:: self.every]

    def frames(self) -> Iterator[Frame]:
        for frame in self.video.frames():
            if frame.index % self.every == 0:
                yield replace(frame, index=frame.index // self.every)


def thinned(recording: vgps.Recording, every: int) -> vgps.Recording:
    """Return a recording whose video shows the first of every so many frames, at its time."""
    return replace(recording, video=_Thinned(recording.video, every))


def first_frames(recording: vgps.Recording, count: int) -> vgps.Recording:
    """Return a recording whose video ends after ``count`` frames."""
    return replace(recording, video=_Beginning(recording.video, count))

"""The beginning of a recording, where the whole would show no more."""

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


def first_frames(recording: vgps.Recording, count: int) -> vgps.Recording:
    """Return a recording whose video ends after ``count`` frames."""
    return replace(recording, video=_Beginning(recording.video, count))

"""Videos made from another one."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from vgps.model import FloatArray, Frame, Video


@dataclass(frozen=True)
class DerivedVideo:
    """A video that is as another one, except for what a subclass changes."""

    video: Video

    @property
    def path(self) -> Path:
        """The file or folder of the other one."""
        return self.video.path

    @property
    def times_s(self) -> FloatArray:
        """(F,) times of the frames."""
        return self.video.times_s

    @property
    def width(self) -> int:
        """Width in pixels."""
        return self.video.width

    @property
    def height(self) -> int:
        """Height in pixels."""
        return self.video.height

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader found."""
        return getattr(self.video, "warnings", ())

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order of presentation."""
        return self.video.frames()

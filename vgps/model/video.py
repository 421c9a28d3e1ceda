"""A video: its frames, and where they show the scene."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from vgps.model.arrays import BoolArray, FloatArray, GrayImage


@dataclass(frozen=True)
class Frame:
    """One decoded frame: index, time [s], its luminance (H, W) uint8, and where it shows the scene (H, W).

    ``repeats`` says that it is known to show the picture of the frame before it again.
    """

    index: int
    t_s: float
    gray: GrayImage
    mask: BoolArray | None = None
    repeats: bool = False


class Masks(Protocol):
    """What the frames of a video show that is not of the scene."""

    @property
    def files(self) -> Sequence[Path]:
        """Their files."""
        ...

    def of_frame(self, index: int) -> BoolArray | None:
        """Return where a frame shows the scene (H, W); None if everywhere."""
        ...


class Video(Protocol):
    """A source of frames: a file, a folder of images, a stream."""

    @property
    def path(self) -> Path:
        """The file or folder."""
        ...

    @property
    def times_s(self) -> FloatArray:
        """(F,) presentation times, seconds since the first frame, strictly increasing."""
        ...

    @property
    def width(self) -> int:
        """Width in pixels, after the rotation by the container's flag."""
        ...

    @property
    def height(self) -> int:
        """Height in pixels, after the rotation by the container's flag."""
        ...

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order of presentation."""
        ...

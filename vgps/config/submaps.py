"""Settings of submaps, in which stage D solves a long recording."""

from typing import ClassVar, Literal

from pydantic import PositiveInt

from vgps.config.base import SettingsModel

_LONG_FRAMES = 20000  # recordings beyond it have submaps by default
_FRAMES = 5000  # of one of these


class SubmapsConfig(SettingsModel):
    """Submaps: stage D of a long recording in memory for a part of it, the rest in files in TMPDIR."""

    basic: ClassVar[tuple[str, ...]] = ("frames",)

    frames: PositiveInt | Literal["auto"] = "auto"
    """Frames of a submap; auto gives recordings of more than 20,000 frames submaps of 5,000. It must be twice
    what tracks span across a cut; where places are seen again, submaps are cut at blocks of 16 frames."""

    def frames_of(self, total: int) -> int | None:
        """Return the frames of a submap of a recording of so many frames; None if it is solved whole."""
        if self.frames == "auto":
            return _FRAMES if total > _LONG_FRAMES else None
        return self.frames

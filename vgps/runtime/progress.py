"""Progress of long work, shown on a terminal or not at all."""

from collections.abc import Iterable
from typing import Protocol

from vgps.model import Frame


class Progress(Protocol):
    """Where long work reports its progress."""

    def track(self, frames: Iterable[Frame], total: int) -> Iterable[Frame]:
        """Yield the same frames while showing how many of ``total`` are done."""
        ...

    def stage(self, name: str) -> None:
        """Announce that a stage begins."""
        ...


class NoProgress:
    """Progress that is not shown."""

    def track(self, frames: Iterable[Frame], total: int) -> Iterable[Frame]:
        """Return the frames."""
        return frames

    def stage(self, name: str) -> None:
        """Do nothing."""

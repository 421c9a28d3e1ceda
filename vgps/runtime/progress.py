"""How long work tells what it does: on a terminal, or not at all."""

from collections.abc import Iterable
from typing import Protocol

from vgps.model import Frame


class Progress(Protocol):
    """Told what is being done; a terminal shows a bar."""

    def track(self, frames: Iterable[Frame], total: int) -> Iterable[Frame]:
        """The same frames, while progress is shown."""
        ...

    def say(self, what: str) -> None:
        """A stage begins."""
        ...


class Silent:
    """No progress shown."""

    def track(self, frames: Iterable[Frame], total: int) -> Iterable[Frame]:
        """As in :class:`Progress`."""
        return frames

    def say(self, what: str) -> None:
        """As in :class:`Progress`."""

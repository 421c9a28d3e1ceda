"""Events that wait for the next frame of a live session, and the warnings among them for its result."""

from collections.abc import Iterable

from vgps.online.estimate import OnlineEvent

_MAX_WARNINGS = 500  # kept for the result


class EventQueue:
    """Events in the order in which they came.

    Attributes:
        warnings: Texts of the first notes, for the result.
    """

    def __init__(self) -> None:
        self._waiting: list[OnlineEvent] = []
        self.warnings: list[str] = []

    def add(self, events: Iterable[OnlineEvent]) -> None:
        """Add events."""
        self._waiting += events

    def add_notes(self, t_s: float, texts: list[str]) -> None:
        """Move texts out of a list, to events at a time of the video and, of the first, to the warnings."""
        self.add(OnlineEvent(t_s, "note", text) for text in texts)
        self.warnings += texts[: max(0, _MAX_WARNINGS - len(self.warnings))]
        texts.clear()

    def take(self) -> tuple[OnlineEvent, ...]:
        """Return the events since the last call."""
        taken, self._waiting = tuple(self._waiting), []
        return taken

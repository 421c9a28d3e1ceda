"""Progress on a terminal: a bar over frames and the name of each stage."""

from collections.abc import Iterable, Iterator

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from vgps.model import Frame


class TerminalProgress:
    """Progress on standard error; nothing if that is not a terminal."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)

    def track(self, frames: Iterable[Frame], total: int) -> Iterator[Frame]:
        """Yield the frames and advance a bar."""
        columns = (TextColumn("frames"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=self._console, disable=not self._console.is_terminal) as bar:
            yield from bar.track(frames, total=total)

    def stage(self, name: str) -> None:
        """Print the name of the stage that begins."""
        if self._console.is_terminal:
            self._console.print(Text(name, "dim"))

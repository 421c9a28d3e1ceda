"""The command line's root, on which verbs hang themselves, and how they speak."""

from cyclopts import App
from rich.console import Console
from rich.text import Text

app = App(name="vgps", help="The pose of every frame of a video in world coordinates, from video and GPS.")


def say(words: str, *, aside: bool = False) -> None:
    """Print a line as it is, on standard error if ``aside``: a path with brackets or colons is no markup."""
    Console(stderr=aside).print(Text(words), soft_wrap=True)


def note(words: str) -> None:
    """Print a line that a user should know, as it is."""
    Console().print(Text.assemble(("note:", "yellow"), f" {words}"), soft_wrap=True)

"""The root of the command line, and how its verbs print."""

from cyclopts import App
from rich.console import Console
from rich.text import Text

app = App(
    name="vgps",
    help="Estimate the pose of every frame of a video in world coordinates, with GPS.",
    suppress_keyboard_interrupt=False,  # vgps.__main__ treats Ctrl-C and SIGTERM apart
)


def print_line(text: str, *, to_stderr: bool = False) -> None:
    """Print a line verbatim: brackets or colons in a path are not markup."""
    Console(stderr=to_stderr).print(Text(text), soft_wrap=True)


def print_note(text: str) -> None:
    """Print a remark that the user should read, verbatim."""
    Console().print(Text.assemble(("note:", "yellow"), f" {text}"), soft_wrap=True)

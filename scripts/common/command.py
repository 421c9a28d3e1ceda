"""Command lines of the scripts: options with their defaults, refusals in one line with exit code 2."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from scripts.common.results import Results
from vgps.errors import VgpsError


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Description as it is written; defaults behind the options that have one."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        shown = action.default not in (None, False, argparse.SUPPRESS, [])
        return f"{action.help or ''} (default: %(default)s)".strip() if shown else action.help


class ScriptParser(argparse.ArgumentParser):
    """Arguments of a script that is run as ``python -m scripts.NAME``.

    Args:
        name: Dotted name of the script below ``scripts``.
        description: Its docstring.
        measures: Whether it has ``--json``, the results file.
    """

    def __init__(self, name: str, description: str | None, *, measures: bool = True) -> None:
        super().__init__(
            prog=f"python -m scripts.{name}", description=description, formatter_class=_Formatter
        )
        self._name = name.rpartition(".")[2]
        self._question = (description or name).splitlines()[0]
        if measures:
            self.add_argument(
                "--json", type=Path, metavar="FILE", help="write the rows, the commit and the machine here"
            )

    def error(self, message: str) -> NoReturn:
        """Exit with code 2 and one line on standard error."""
        self.exit(2, f"{self._name}: {message}; see --help\n")

    @contextmanager
    def refusals(self) -> Iterator[None]:
        """Turn bad input inside the block into one line on standard error and exit code 2."""
        try:
            yield
        except VgpsError as error:
            self.exit(2, f"{self._name}: {error}\n")

    def results(self, given: argparse.Namespace) -> Results:
        """Return the results file of ``--json``, empty so far."""
        return Results(given.json, self._question)


def add_jobs(parser: argparse.ArgumentParser, what: str, default: int = 1) -> None:
    """Add ``--jobs``, the number of processes."""
    parser.add_argument("--jobs", type=int, default=default, help=f"{what} at the same time")


def add_recording_and_logs(parser: argparse.ArgumentParser) -> None:
    """Add a recording with truth and ``--logs``, the GPS logs to take in turn."""
    parser.add_argument("recording", type=Path, help="with truth")
    parser.add_argument("--logs", nargs="+", required=True, help="paths, or names inside the recording")


def add_seeds(parser: argparse.ArgumentParser, default: int, **options: Any) -> None:
    """Add ``--seeds``, the number of repetitions with other random numbers."""
    parser.add_argument("--seeds", type=int, default=default, help="number of seeds, from 0", **options)

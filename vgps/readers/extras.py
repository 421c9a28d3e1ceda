"""Libraries of optional formats, imported when a file needs them."""

import contextlib
import importlib
import os
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from vgps.errors import GpsLogError


def optional_module(name: str, extra: str, path: object) -> ModuleType:
    """Return a module.

    Raises:
        GpsLogError: It is not installed; the message names the extra that has it.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise GpsLogError(
            f"needs the library {name.split('.', maxsplit=1)[0]}, which is not installed",
            file=str(path),
            remedy=f"pip install 'vgps[{extra}]'",
        ) from error


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Silence what a library prints about damage; the notes of the log say what was skipped."""
    with (
        Path(os.devnull).open("w") as silent,
        contextlib.redirect_stdout(silent),
        contextlib.redirect_stderr(silent),
    ):
        yield

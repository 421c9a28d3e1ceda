"""Runs and folders that several tests examine: made once, whatever the number of pytest-xdist's workers."""

import fcntl
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from vgps.solution import Solution

SharedRun = Callable[[str, Callable[[], "Solution"]], "Solution"]
SharedFolder = Callable[[str, Callable[[Path], object]], Path]


def run_sharing(factory: pytest.TempPathFactory) -> SharedRun:
    """Return a function that makes the run of a name, or reads it if any worker has made it."""
    folder = _of_all_workers(factory)

    def shared(name: str, make: Callable[[], "Solution"]) -> "Solution":
        file = folder / f"{name}.pickle"
        with _locked(folder, name):
            if not file.exists():
                file.write_bytes(pickle.dumps(make()))
        found: Solution = pickle.loads(file.read_bytes())
        return found

    return shared


def folder_sharing(factory: pytest.TempPathFactory) -> SharedFolder:
    """Return a function that makes the folder of a name, or finds it if any worker has made it."""
    folder = _of_all_workers(factory)

    def shared(name: str, make: Callable[[Path], object]) -> Path:
        made = folder / f"{name}.made"
        with _locked(folder, name):
            if not made.exists():
                make(folder / name)
                made.touch()
        return folder / name

    return shared


def _of_all_workers(factory: pytest.TempPathFactory) -> Path:
    base = factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@contextmanager
def _locked(folder: Path, name: str) -> Iterator[None]:
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the other workers wait for the one that makes it
        yield

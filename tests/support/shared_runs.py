"""Runs that several tests examine: made once, whatever the number of pytest-xdist's workers."""

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path

import pytest

from vgps.solution import Solution

SharedRun = Callable[[str, Callable[[], Solution]], Solution]


def run_sharing(factory: pytest.TempPathFactory) -> SharedRun:
    """Return a function that makes the run of a name, or reads it if any worker has made it."""
    base = factory.getbasetemp()
    folder: Path = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def shared(name: str, make: Callable[[], Solution]) -> Solution:
        file = folder / f"{name}.pickle"
        with (folder / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # the other workers wait for the one that makes it
            if not file.exists():
                file.write_bytes(pickle.dumps(make()))
        found: Solution = pickle.loads(file.read_bytes())
        return found

    return shared

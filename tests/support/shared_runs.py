"""Runs and folders that several tests examine: made once, whatever the number of pytest-xdist's workers."""

import fcntl
import os
import pickle
import sys
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


def smooth_by_command(recording: Path, out: Path) -> None:
    """Run ``vgps smooth``, and keep what it wrote for :func:`written_by_command`."""
    from vgps.cli import main
    from vgps.cluster import job

    def write(solution: "Solution", folder: Path) -> None:
        out.with_suffix(".pickle").write_bytes(pickle.dumps(solution))
        write_run(solution, folder)

    write_run = job.write_run
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys, "argv", ["vgps", "smooth", str(recording), "--out", str(out)])
        patched.setattr(job, "write_run", write)
        with pytest.raises(SystemExit) as ended:
            main()
    assert not ended.value.code


def written_by_command(out: Path) -> "Solution":
    """Return the solution of a run folder of :func:`smooth_by_command`, all of it and to the last digit."""
    solution: Solution = pickle.loads(out.with_suffix(".pickle").read_bytes())
    return solution


def _of_all_workers(factory: pytest.TempPathFactory) -> Path:
    base = factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@contextmanager
def _locked(folder: Path, name: str) -> Iterator[None]:
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the other workers wait for the one that makes it
        yield

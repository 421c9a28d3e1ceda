"""Fixtures that every test may use."""

import gc
import os
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from typing import TYPE_CHECKING

import compiled_modules  # noqa: F401, as the first one
import pytest
from hypothesis import settings
from shared_runs import (
    SharedFolder,
    SharedRun,
    folder_sharing,
    run_sharing,
    smooth_by_command,
    written_by_command,
)
from threadpoolctl import threadpool_limits

# pytest-xdist's own process reads this file before it starts the workers: vgps is imported when it is used
if TYPE_CHECKING:
    from vgps.solution import Solution

Verb = Callable[..., tuple[int, str, str]]

if "PYTEST_XDIST_WORKER" in os.environ:  # a worker for each core: more threads would wait for each other
    os.environ.setdefault("OMP_NUM_THREADS", "1")

settings.register_profile("vgps", deadline=None)  # a loaded machine is no failure
settings.load_profile("vgps")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Import all tests; the garbage collector need not look through what stays to the end, now or later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_finish() -> None:
    """Small matrices: BLAS's threads would wait for each other, and for those of the other worker."""
    threadpool_limits(limits=1, user_api="blas")  # of the libraries that are loaded, as by all tests' files


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real recordings, or skip the test."""
    default = Path(__file__).resolve().parents[1] / "../shared/data"
    folder = Path(os.environ.get("VGPS_DATA", default)).resolve()
    if not folder.is_dir():
        pytest.skip(f"{folder}: no real recordings; set VGPS_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def shared_run(tmp_path_factory: pytest.TempPathFactory) -> SharedRun:
    """Return a function that gives the run of a name, which it makes if no worker has it yet."""
    return run_sharing(tmp_path_factory)


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> SharedFolder:
    """Return a function that gives the folder of a name, which it makes if no worker has it yet."""
    return folder_sharing(tmp_path_factory)


@pytest.fixture(scope="session")
def recording(shared_folder: SharedFolder) -> Path:
    """Return a small simulated recording with its truth; copy it before changing it."""
    from recordings import small_recording

    return shared_folder("walk", small_recording)


@pytest.fixture(scope="session")
def brief(shared_folder: SharedFolder) -> Path:
    """Return a recording half as long, for what a verb does and not how well; copy before changing it."""
    from recordings import brief_recording

    return shared_folder("brief", brief_recording)


@pytest.fixture(scope="session")
def shaken(shared_folder: SharedFolder) -> Path:
    """Return a recording whose shutter rolls."""
    from recordings import shaken_recording

    return shared_folder("shaken", shaken_recording)


@pytest.fixture(scope="session")
def smoothed(recording: Path, shared_folder: SharedFolder) -> Path:
    """The run folder of the small recording, made by the command as vgps is configured by default."""
    return shared_folder("run", lambda out: smooth_by_command(recording, out))


@pytest.fixture(scope="session")
def smoothed_walk(smoothed: Path) -> "Solution":
    """The run of the small recording that the command wrote."""
    return written_by_command(smoothed)


@pytest.fixture(scope="session")
def smoothed_brief(brief: Path, shared_folder: SharedFolder) -> Path:
    """The run folder of the brief recording, made by the command as vgps is configured by default."""
    return shared_folder("brief_run", lambda out: smooth_by_command(brief, out))


@pytest.fixture(scope="session")
def kitti07_fixed(data_dir: Path, shared_run: SharedRun) -> "Solution":
    """The run of the real drive kitti07 with its RTK-fixes."""
    import vgps

    drive = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea")
    return shared_run("kitti07_fixed", lambda: vgps.smooth(drive))


@pytest.fixture
def vgps_verb(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Verb:
    """Run a verb; return its exit code, standard output and standard error."""
    from vgps.cli import main

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["vgps", *map(str, words)])
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        return code, *capsys.readouterr()

    return run

"""Files and folders that get their final name only when they are complete."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vgps.errors import RunFolderError
from vgps.writers.claim import EARLIER, SCRATCH, claimed, not_writable

MARK = "solution.json"  # the file that marks a folder as a run


def check_writable(out: Path, mark: str = MARK) -> None:
    """Check before long work that a run can be written to ``out``; change nothing.

    Args:
        out: The folder.
        mark: The file that marks an earlier one.

    Raises:
        RunFolderError: ``out`` is a file, a mount point, a folder with something other than an earlier run,
            or in a place that cannot be written.
    """
    try:
        _check_folder(out.resolve(), mark)
    except OSError as error:
        raise not_writable(out, error) from error


def check_file(out: Path) -> None:
    """Check before long work that a file can be written as ``out``; change nothing.

    Raises:
        RunFolderError: ``out`` is a folder, or in a place that cannot be written.
    """
    if out.is_dir():
        raise RunFolderError("is a folder", file=out, expected="the name of a file to write")
    try:
        _check_place(out.resolve())
    except OSError as error:
        raise not_writable(out, error) from error


@contextmanager
def new_folder(out: Path, own_files: tuple[str, ...], mark: str = MARK) -> Iterator[Path]:
    """Yield a temporary sibling of ``out``, which is renamed to ``out`` when the block succeeds.

    An earlier folder of that name, marked by the file ``mark``, is replaced only when the new one is
    complete; its files other than ``own_files`` are kept.

    Raises:
        RunFolderError: As :func:`check_writable`, or writing fails.
    """
    check_writable(out, mark)
    out = out.resolve()
    with claimed(out), _scratch_beside(out) as scratch:
        folder = scratch / "run"  # mkdtemp's folder is private to the user; this one follows the umask
        folder.mkdir()
        yield folder
        _swap(folder, out, scratch / EARLIER, own_files)


@contextmanager
def new_file(out: Path) -> Iterator[Path]:
    """Yield a temporary sibling of the file ``out``, which replaces ``out`` when the block succeeds.

    Raises:
        RunFolderError: ``out`` is a folder, or cannot be written.
    """
    check_file(out)
    out = out.resolve()
    with claimed(out), _scratch_beside(out) as scratch:
        yield scratch / out.name
        (scratch / out.name).replace(out)


@contextmanager
def _scratch_beside(out: Path) -> Iterator[Path]:
    """Yield a temporary folder beside ``out``, which goes with the block unless it holds an earlier run."""
    try:
        scratch = Path(tempfile.mkdtemp(prefix=SCRATCH.format(out.name), dir=out.parent))
        try:
            yield scratch
        finally:
            if not (scratch / EARLIER).exists():  # else the swap failed
                shutil.rmtree(scratch, ignore_errors=True)
    except OSError as error:
        raise not_writable(out, error) from error


def _check_folder(out: Path, mark: str) -> None:
    if out.exists() and not out.is_dir():
        raise RunFolderError("is a file", file=out, expected="a folder", remedy="name another --out")
    if out.is_mount():
        raise RunFolderError(
            "is a mount point, which cannot be replaced", file=out, remedy="name a folder inside it as --out"
        )
    if out.is_dir() and not (out / mark).is_file() and any(out.iterdir()):
        raise RunFolderError(
            f"holds other files and no {mark}",
            file=out,
            expected=f"an empty folder or one with {mark}",
            remedy="name another --out; nothing was overwritten",
        )
    _check_place(out)


def _check_place(out: Path) -> None:
    nearest = next(parent for parent in out.parents if parent.exists())
    if not nearest.is_dir():
        raise RunFolderError(
            f"{nearest} is a file", file=out, expected="a folder", remedy="name another --out"
        )
    with tempfile.TemporaryDirectory(prefix=".vgps-", dir=nearest):
        pass  # the only reliable test of permissions, quotas and read-only disks


def _swap(new: Path, out: Path, aside: Path, own_files: tuple[str, ...]) -> None:
    if not out.exists():
        new.rename(out)
        return
    out.rename(aside)
    try:
        new.rename(out)
    except OSError:
        aside.rename(out)
        raise
    for entry in aside.iterdir():
        if entry.name not in own_files:
            entry.rename(out / entry.name)
    shutil.rmtree(aside)

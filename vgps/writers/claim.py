"""One process at a time writes an output; what a killed one left behind is removed."""

import contextlib
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from vgps.errors import RunFolderError

if sys.platform != "win32":
    import fcntl

SCRATCH = ".{}.new-"  # beginning of the name of an output's scratch folder
EARLIER = "earlier"  # the run that is being replaced, in the scratch folder
_HELD: set[Path] = set()  # by this process, whose parts may claim the same output again


@contextlib.contextmanager
def claimed(out: Path) -> Iterator[None]:
    """Keep other processes from writing ``out`` inside the block.

    The lock is on a hidden file beside ``out`` and ends with the process, however that ends.

    Raises:
        RunFolderError: Another process is writing ``out``, or its folder cannot be written.
    """
    out = out.resolve()
    if out in _HELD or sys.platform == "win32":
        yield
        return
    file = out.with_name(f".{out.name}.lock")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        lock = _locked(file, out)
    except OSError as error:
        raise not_writable(out, error) from error
    _HELD.add(out)
    try:
        _remove_leftovers(out)
        yield
    finally:
        _HELD.discard(out)
        file.unlink(missing_ok=True)
        os.close(lock)


def not_writable(out: Path, error: OSError) -> RunFolderError:
    """Return the error to raise for an output that the system refuses."""
    reason = error.strerror or os.strerror(error.errno or 0)
    return RunFolderError(
        f"cannot be written ({reason})",
        file=out,
        remedy="check permissions and free space, or name another --out",
    )


def _locked(file: Path, out: Path) -> int:
    """Return a descriptor with the lock; the file may be removed by its last holder while this one waits."""
    while True:
        lock = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(lock, 20).decode("ascii", "replace").strip()
            os.close(lock)
            raise RunFolderError(
                f"is being written by another vgps (process {holder or 'unknown'})",
                file=out,
                remedy="wait until it ends, or name another output",
            ) from None
        if file.exists() and os.path.samestat(os.fstat(lock), file.stat()):
            os.ftruncate(lock, 0)
            with contextlib.suppress(OSError):  # of a full disk: the number only serves another's message
                os.pwrite(lock, f"{os.getpid()}\n".encode(), 0)
            return lock
        os.close(lock)


def _remove_leftovers(out: Path) -> None:
    """Remove scratch folders of processes that were killed; one that holds an earlier run is put back."""
    for scratch in out.parent.glob(f"{SCRATCH.format(out.name)}*"):
        earlier = scratch / EARLIER
        if earlier.is_dir() and not out.exists():
            earlier.rename(out)
        if not earlier.exists():
            shutil.rmtree(scratch, ignore_errors=True)

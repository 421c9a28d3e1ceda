"""Many damaged files through one reader, each within limits of time and memory, in a process of its own."""

import logging
import multiprocessing
import random
import resource
import shutil
import signal
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from types import FrameType

from scripts.experiments.fuzz.mutators import mutate
from scripts.experiments.fuzz.targets import Target
from vgps.errors import VgpsError

LONGEST_S = 5.0  # of processor time for one file
LARGEST_MB = 1024.0  # of a process that reads one file
LONGEST_MESSAGE = 2000
STUCK_S = 60.0  # of wall time without progress: waiting for something that never comes
_ADDRESS_SPACE = 8 * 2**30  # beyond it an allocation fails


class _TooLong(BaseException):
    """A reader took longer than :data:`LONGEST_S`."""


@dataclass(frozen=True)
class Finding:
    """A file that a reader did not take well: the number that makes it again, the kind, and the words."""

    target: str
    number: int
    kind: str
    text: str


@dataclass(kw_only=True)
class Tally:
    """What became of the files of a target; times in seconds of processor time."""

    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    findings: list[Finding] = field(default_factory=list)
    seconds: float = 0.0
    slowest_s: float = 0.0
    largest_mb: float = 0.0

    def add(self, more: "Tally") -> None:
        """Add what became of other files."""
        self.inputs += more.inputs
        self.accepted += more.accepted
        self.refused += more.refused
        self.findings += more.findings
        self.seconds += more.seconds
        self.slowest_s = max(self.slowest_s, more.slowest_s)
        self.largest_mb = max(self.largest_mb, more.largest_mb)


def damaged(target: Target, seed: int, number: int) -> tuple[str, bytes]:
    """Return name and content of a damaged file; the same for the same arguments."""
    rng = random.Random(f"{target.name} {seed} {number}")
    source = rng.choice(target.seeds())
    return target.file or source.name, mutate(source.read_bytes(), target.mutators, rng)


def fuzz(target: Target, numbers: range, seed: int, kept: Path | None = None) -> Tally:
    """Give damaged files to a reader, in a process that is replaced when it dies or hangs.

    Args:
        target: The reader.
        numbers: Numbers of the files.
        seed: Makes other files.
        kept: Folder in which the files of findings are kept.
    """
    tally, first = Tally(), numbers.start
    context = multiprocessing.get_context("fork")
    while first < numbers.stop:
        now = context.Value("q", first)
        ours, theirs = context.Pipe(duplex=False)
        worker = context.Process(target=_work, args=(target, range(first, numbers.stop), seed, now, theirs))
        worker.start()
        theirs.close()
        ending = _collect(worker, now, ours, tally)
        first = int(now.value) + 1
        if ending:
            tally.inputs += 1
            tally.findings.append(Finding(target.name, first - 1, ending, f"exit code {worker.exitcode}"))
    if kept is not None:
        _keep(target, tally, seed, kept)
    return tally


def _collect(
    worker: BaseProcess, now: "Synchronized[int]", ours: "Connection[None, Tally | None]", tally: Tally
) -> str:
    """Add up what a worker reports, and return how it ended if it did not finish: crash or hang."""
    before, since_s = -1, time.monotonic()
    while True:
        if int(now.value) != before:
            before, since_s = int(now.value), time.monotonic()
        if time.monotonic() - since_s > STUCK_S:
            worker.kill()
            worker.join()
            return "hang"
        try:
            if not ours.poll(1.0):
                continue
            report = ours.recv()
        except (EOFError, OSError):
            worker.join()
            return "crash"
        if report is None:
            worker.join()
            return ""
        tally.add(report)


def _work(
    target: Target, numbers: range, seed: int, now: "Synchronized[int]", out: "Connection[Tally | None, None]"
) -> None:
    """Read the files, and report on each."""
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGPROF, _stop)
    warnings.simplefilter("ignore")
    logging.disable()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "files"
        folder.mkdir()
        for beside in target.companions():
            shutil.copy(beside, folder)
        for number in numbers:
            now.value = number
            name, content = damaged(target, seed, number)
            file = folder / name
            file.write_bytes(content)
            out.send(_one(target, number, file))
            file.unlink()
    out.send(None)


def _one(target: Target, number: int, file: Path) -> Tally:
    tally = Tally(inputs=1)
    _forget_peak()
    begun = time.process_time()
    try:
        with _limited():
            target.read(file)
        tally.accepted += 1
    except VgpsError as error:
        tally.refused += 1
        text = str(error)
        if "\n" in text or len(text) > LONGEST_MESSAGE or not text.isprintable():
            tally.findings.append(Finding(target.name, number, "message", text[:200]))
    except _TooLong:
        tally.findings.append(Finding(target.name, number, "slow", f"longer than {LONGEST_S} s"))
    except BaseException as error:
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else ""
        found = f"{type(error).__name__} at {place}: {str(error)[:150]}"
        tally.findings.append(Finding(target.name, number, "traceback", found))
    taken_s, peak_mb = time.process_time() - begun, _peak_mb()
    tally.seconds = tally.slowest_s = taken_s
    tally.largest_mb = peak_mb
    if peak_mb > LARGEST_MB:
        tally.findings.append(Finding(target.name, number, "memory", f"{peak_mb:.0f} MB"))
    return tally


def _stop(_: int, __: FrameType | None) -> None:
    raise _TooLong


@contextmanager
def _limited() -> Iterator[None]:
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _forget_peak() -> None:
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak_mb() -> float:
    """Return the largest resident size since it was last forgotten, or since the start where it cannot be."""
    with suppress(OSError, StopIteration):
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # macOS counts bytes


def _keep(target: Target, tally: Tally, seed: int, folder: Path) -> None:
    for finding in tally.findings:
        name, content = damaged(target, seed, finding.number)
        place = folder / target.name
        place.mkdir(parents=True, exist_ok=True)
        (place / f"{finding.kind}-{seed}-{finding.number}-{name}").write_bytes(content)

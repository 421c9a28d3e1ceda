"""Wall and processor time of a block."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass
class Elapsed:
    """Seconds of a block: on the wall, of all threads of the process, and of the calling thread."""

    wall_s: float = float("nan")
    cpu_s: float = float("nan")
    thread_s: float = float("nan")


@contextmanager
def stopwatch() -> Iterator[Elapsed]:
    """Measure a ``with`` block; the times are there when it ends."""
    elapsed = Elapsed()
    wall, cpu, thread = time.perf_counter(), time.process_time(), time.thread_time()
    try:
        yield elapsed
    finally:
        elapsed.thread_s = time.thread_time() - thread
        elapsed.cpu_s = time.process_time() - cpu
        elapsed.wall_s = time.perf_counter() - wall

"""Threads: one for linear algebra on small blocks, one ahead or beside, several for parts of an array.

BLAS's own threads have too little to share in small blocks: on busy cores, threads waiting for each other
cost fourfold, and their number changes the last digits.
"""

import contextlib
import os
import queue
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from itertools import islice
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")

_AHEAD = 8  # items made ahead: a frame at 4K is 8 MB
_PROMPT_S = 5e-4  # instead of Python's 5 ms
_MOST_BEGUN = 32  # functions at once; each camera of a rig has some
_FEWEST = 4  # items, of some milliseconds each, for which threads are worth starting


@cache
def _controller() -> ThreadpoolController:
    # finding the libraries takes 7 ms, too long to repeat for every frame
    return ThreadpoolController()


class _Held(threading.local):
    """Whether this thread holds BLAS to one thread."""

    already = False


_held = _Held()


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread; inside another such context of the same thread that costs nothing.

    The number is one for the whole process: whoever begins functions beside holds it until they end, else it
    changes under them, and with it their last digits.
    """
    if _held.already:
        yield
        return
    with _controller().limit(limits=1, user_api="blas"):
        _held.already = True
        try:
            yield
        finally:
            _held.already = False


def begin(
    function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Future[Result]:
    """Call a function in a thread beside this one, and return what will hold its result.

    Threads are kept: on busy cores the start of one takes longer than a frame, and the caller waits for it.
    """
    return _begun().submit(function, *args, **kwargs)


@cache
def _begun() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_MOST_BEGUN)


os.register_at_fork(after_in_child=_begun.cache_clear)  # its threads are the parent's


@contextlib.contextmanager
def prompt_threads() -> Iterator[None]:
    """Let a thread that is ready go on half a millisecond later, though another one computes in Python.

    A pose gives way whenever NumPy or OpenCV let others run, and would wait 5 ms each time to go on.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(min(before, _PROMPT_S))
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def process_cores() -> int:
    """Return the number of cores that the system lets this process use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def usable_cores() -> int:
    """Return the number of cores to compute on: those of the process; ``OMP_NUM_THREADS`` lowers it."""
    cores = process_cores()
    wanted = os.environ.get("OMP_NUM_THREADS", "").split(",")[0]
    return min(cores, int(wanted)) if wanted.isdecimal() and int(wanted) else cores


def map_in_order(function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
    """Yield ``function(item)`` of every item, in order, computed by a thread for each usable core.

    No more than two items for each thread are under way. NumPy's arithmetic, indexing and products let other
    threads run meanwhile.
    """
    threads = usable_cores()
    if threads == 1 or len(items) < _FEWEST:
        yield from map(function, items)
        return
    rest, waiting = iter(items), deque[Future[Result]]()
    with ThreadPoolExecutor(threads) as pool:
        waiting.extend(pool.submit(function, item) for item in islice(rest, 2 * threads))
        while waiting:
            result = waiting.popleft().result()
            waiting.extend(pool.submit(function, item) for item in islice(rest, 1))
            yield result


def run_ahead(produce: Callable[[], Generator[Item]]) -> Generator[Item]:
    """Yield what a generator yields, which runs a few items ahead in a thread of its own.

    The thread ends when the iterator is closed. An error of the generator is raised here.
    """
    items: queue.Queue[tuple[Item | None, BaseException | None]] = queue.Queue(_AHEAD)
    stop = threading.Event()

    def put(item: Item | None, error: BaseException | None) -> bool:
        while not stop.is_set():
            with contextlib.suppress(queue.Full):
                items.put((item, error), timeout=0.1)
                return True
        return False

    def work() -> None:
        try:
            with contextlib.closing(produce()) as source:
                for item in source:
                    if not put(item, None):
                        return
            put(None, StopIteration())
        except BaseException as error:
            put(None, error)

    thread = threading.Thread(target=work, name="ahead", daemon=True)
    thread.start()
    try:
        while True:
            item, error = items.get()
            if isinstance(error, StopIteration):
                return
            if error is not None:
                raise error
            yield item  # type: ignore[misc]
    finally:
        stop.set()
        with contextlib.suppress(queue.Empty):
            while True:
                items.get_nowait()
        thread.join()

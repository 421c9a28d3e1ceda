"""Threads: one for linear algebra on small blocks, one beside the frames, several for parts of an array.

BLAS's own threads have too little to share in small blocks: on busy cores, threads waiting for each other
cost fourfold, and their number changes the last digits.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from itertools import islice
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")

_FEWEST = 4  # items, of some milliseconds each, for which threads are worth starting


@cache
def _controller() -> ThreadpoolController:
    # finding the libraries takes 7 ms, too long to repeat for every frame
    return ThreadpoolController()


def one_blas_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread."""
    limits: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limits


def begin(
    function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Future[Result]:
    """Call a function in a thread of its own, and return what will hold its result."""
    executor = ThreadPoolExecutor(1)
    result = executor.submit(function, *args, **kwargs)
    executor.shutdown(wait=False)
    return result


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

"""Linear algebra in one thread: the blocks here are too small to share.

On busy cores, threads waiting for each other cost fourfold, and their number changes the last digits.
"""

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


@cache
def _controller() -> ThreadpoolController:
    # finding the libraries takes 7 ms, too long to repeat for every frame
    return ThreadpoolController()


def one_blas_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread."""
    limits: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limits

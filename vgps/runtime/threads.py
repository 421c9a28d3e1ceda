"""One thread for linear algebra: blocks this small are not worth sharing.

On busy cores threads that wait for each other cost fourfold, and results differ in the last digits with their
number.
"""

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


@cache
def _controller() -> ThreadpoolController:
    # looking for the libraries takes 7 ms, too long for every frame
    return ThreadpoolController()


def one_blas_thread() -> AbstractContextManager[object]:
    """A context in which BLAS uses one thread."""
    limits: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limits

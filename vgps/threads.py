"""One thread for linear algebra: blocks this small are not worth sharing.

On busy cores threads that wait for each other cost fourfold, and results differ in the last digits with their
number.
"""

from contextlib import AbstractContextManager

from threadpoolctl import threadpool_limits


def one_blas_thread() -> AbstractContextManager[object]:
    """A context in which BLAS uses one thread; usable as a decorator too."""
    limits: AbstractContextManager[object] = threadpool_limits(limits=1, user_api="blas")
    return limits

"""Return of freed memory to the operating system.

Large, rare allocations, above all the scaled pictures in which a lost camera is searched, leave free memory
that glibc never returns by itself; on a long run this looks like a leak.
"""

import ctypes
import sys


def release_free_memory() -> None:
    """Return free memory to the system where the C library can (glibc); takes 1 to 5 ms."""
    if sys.platform != "linux":
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)

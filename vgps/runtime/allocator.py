"""Memory that was freed, given back to the operating system.

What is large and rare, the scaled pictures in which a lost camera is sought above all, leaves free memory
behind that glibc keeps for good: on a long run it looks like a leak.
"""

import ctypes
import sys


def give_back_memory() -> None:
    """Let go of free memory, where the C library can be asked to (glibc); it takes 1 to 5 ms."""
    if sys.platform != "linux":
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)

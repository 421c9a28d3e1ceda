"""Memory of this process."""

import resource
from pathlib import Path


def resident_mb() -> float:
    """Return the memory that the process holds now, MB; the most it has held where only that is known."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text().split()[1]) * resource.getpagesize() / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # macOS counts bytes

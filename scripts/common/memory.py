"""Memory of this process."""

import resource
from pathlib import Path

from vgps.runtime.memory import peak_memory_mb


def resident_mb() -> float:
    """Return the memory that the process holds now, MB; the most it has held where only that is known."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text().split()[1]) * resource.getpagesize() / 2**20
    return peak_memory_mb()

"""Memory of this process."""

import math
import sys

if sys.platform != "win32":
    import resource


def peak_memory_mb() -> float:
    """Return the most memory that the process has held, MB; NaN where the system does not say."""
    if sys.platform == "win32":
        return math.nan
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)  # macOS counts bytes

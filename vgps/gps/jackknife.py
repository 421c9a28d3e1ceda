"""Standard deviations by what estimates from fixes are without one part of the video after the other.

They know of errors that last longer than from one fix to the next, as the drift of a video's scale and
heading (Tukey, Bias and confidence in not quite large samples, 1958).
"""

from collections.abc import Sequence

import numpy as np

from vgps.gps.fixes import Fixes
from vgps.model import FloatArray

BLOCKS = 4, 10  # at least and at most
MIN_PAIRS = 8  # of fixes: two in each block


def without_blocks(fixes: Fixes, number: int) -> list[Fixes]:
    """Return the fixes without those of one part of their time after the other, of ``number`` within 4 to 10
    parts."""
    edges = np.linspace(fixes.t_s[0], fixes.t_s[-1], int(np.clip(number, *BLOCKS)) + 1)
    block = np.searchsorted(edges[1:-1], fixes.t_s)
    return [fixes.where(block != k) for k in range(len(edges) - 1)]


def jackknife_sigma(values: Sequence[float] | FloatArray) -> float:
    """Return the standard deviation of an estimate from those (n,) without one part of the data each."""
    return float(np.sqrt((len(values) - 1) * np.var(values)))

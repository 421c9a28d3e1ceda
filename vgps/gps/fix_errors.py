"""Errors of fixes by the regions of their classes, which hold 95 % of them."""

from itertools import pairwise

import numpy as np

from vgps.gps.fixes import Fixes
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FloatArray
from vgps.solution import FixTable


def fix_errors(fixes: Fixes, draws: int, rng: np.random.Generator) -> FloatArray:
    """Draw errors (M, 3, K) east, north, up: a Gauss-Markov process through fixes of one correlation time.

    The correlation time, after which an error counts as independent, is the two-sided integral of the
    autocorrelation; the process decays to 1/e in half of it. It is scaled by the region of each fix: a fix
    whose region was enlarged has the error of its class, only larger.
    """
    white = rng.standard_normal((len(fixes), 3, draws))
    unit = np.empty_like(white)
    for correlation_s in np.unique(fixes.correlation_s):
        same = np.flatnonzero(fixes.correlation_s == correlation_s)
        unit[same[0]] = white[same[0]]
        for before, row in pairwise(same.tolist()):
            gap_s = fixes.t_s[row] - fixes.t_s[before]
            decay = np.exp(-2.0 * gap_s / correlation_s)
            unit[row] = decay * unit[before] + np.sqrt(1.0 - decay**2) * white[row]
    return np.asarray(region_sigmas(fixes)[:, :, None] * unit)


def region_sigmas(fixes: Fixes | FixTable) -> FloatArray:
    """Return standard deviations (M, 3) east, north, up of errors of which the region holds 95 %."""
    horizontal, vertical = fixes.r_m / INSIDE_PLANE, fixes.h_m / INSIDE_LINE
    return np.stack([horizontal, horizontal, vertical], axis=1)

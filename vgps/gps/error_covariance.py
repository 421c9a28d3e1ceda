"""Covariance of the errors of fixes: offsets that last, their walk, and the noise about them."""

import numpy as np

from vgps.config import GpsConfig
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.offset_errors import averaged_over_receivers, one_sigma, walk_scale
from vgps.gps.offset_regions import with_offset_regions
from vgps.gps.offsets import chain_offsets
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FloatArray


def error_covariances(fixes: Fixes, config: GpsConfig) -> FloatArray:
    """Return the covariances (3, M, M) of the errors of fixes along east, north and up, square metres.

    The offsets of a stretch have the variance ``s^2`` that their region says, and part with time:
    ``s^2 exp(-v(dt) / (2 s^2))``, where ``v`` is the variance of the walk over ``dt``. So an offset common to
    a stretch moves all its fixes alike, however many there are.

    Args:
        fixes: In order of time, all of a class with a region.
        config: Regions, and errors of the classes with memory.
    """
    chain = chain_offsets(fixes, np.ones(len(fixes), dtype=bool), config)
    stretch = np.cumsum(chain.starts)[chain.offset]
    bounded = with_offset_regions(fixes, config)
    apart_s = np.abs(fixes.t_s[:, None] - fixes.t_s)
    result = np.zeros((3, len(fixes), len(fixes)))
    for name in np.unique(stretch).tolist():
        rows = np.flatnonzero(stretch == name)
        errors = averaged_over_receivers(config.offset_errors(CLASSES[int(fixes.fix_class[rows[0]])]))
        one = one_sigma(errors)
        walked = (one * walk_scale(errors, apart_s[np.ix_(rows, rows)])) ** 2
        horizontal = (float(np.median(bounded.r_m[rows])) / INSIDE_PLANE) ** 2
        vertical = (float(np.median(bounded.h_m[rows])) / INSIDE_LINE) ** 2
        for axis, variance, ratio in (
            (0, horizontal, 1.0),
            (1, horizontal, 1.0),
            (2, vertical, errors.vertical),
        ):
            offset = variance * np.exp(-(ratio**2) * walked / (2.0 * variance))
            noise = (ratio * one * errors.noise_m) ** 2 + fixes.logging_sigma_m[rows, axis] ** 2
            result[axis][np.ix_(rows, rows)] = offset + np.diag(noise)
    return result

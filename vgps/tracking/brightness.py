"""Pictures as bright as each other: Lucas and Kanade's method takes gray values to stay as they are.

They do not where an exposure follows a tunnel, the sun or headlights: a picture of twice the brightness could
end a map.
"""

import cv2
import numpy as np

from vgps.model import FloatArray, GrayImage

_NOTABLE = 0.2  # logarithm of a gain: matches bear it, and what comes into view may look like one
_SHARES = (0.1, 0.5, 0.9)  # of the pixels that are darker: borders and lamps count little
_FAINT = 4.0  # gray values: in the dark a step of one is no gain
_LEAST_SPREAD = 2.0  # gray values: a black or white picture shows nothing at any gain
_EVERY_PX = 8  # of rows and columns


def equally_bright(first: GrayImage, second: GrayImage) -> tuple[GrayImage, GrayImage]:
    """Return two pictures of one scene with the same median and spread of gray values.

    The one with less spread is stretched, so that neither loses its texture. What nearly agrees stays.
    """
    a, b = _quantiles(first), _quantiles(second)
    spread, other_spread = a[2] - a[0], b[2] - b[0]
    gain = np.log((a + _FAINT) / (b + _FAINT))
    if min(spread, other_spread) < _LEAST_SPREAD or np.abs(gain).max() < _NOTABLE:
        return first, second
    if spread < other_spread:
        return _stretched(first, a[1], b[1], other_spread / spread), second
    return first, _stretched(second, b[1], a[1], spread / other_spread)


def _quantiles(gray: GrayImage) -> FloatArray:
    """Return gray values (3,) than which the shares of the pixels are darker."""
    sample = np.ascontiguousarray(gray[::_EVERY_PX, ::_EVERY_PX])
    darker = np.cumsum(cv2.calcHist([sample], [0], None, [256], [0, 256]))
    return np.searchsorted(darker, np.array(_SHARES) * sample.size).astype(float)


def _stretched(gray: GrayImage, median: float, wanted_median: float, gain: float) -> GrayImage:
    values = wanted_median + gain * (np.arange(256) - median)
    return np.asarray(cv2.LUT(gray, np.clip(np.rint(values), 0, 255).astype(np.uint8)))

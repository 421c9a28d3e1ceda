"""Templates found in the image by normalised cross-correlation, (D) of Matsuda 2007."""

from dataclasses import dataclass

import cv2
import numpy as np

from vgps.landmarks.blur import Float32Array
from vgps.model import FloatArray


@dataclass(frozen=True)
class Matches:
    """Where templates were found: ``uv_px`` (N, 2), ``correlation`` (N,), -1 where there was no place."""

    uv_px: FloatArray
    correlation: FloatArray


def match_templates(
    image: Float32Array,
    templates: Float32Array,
    predicted_px: FloatArray,
    radius_px: FloatArray,
    min_contrast: float = 0.0,
) -> Matches:
    """The place of highest normalised cross-correlation in a window around each prediction.

    Args:
        image: (H, W) grey, float32.
        templates: (N, M, M), M odd.
        predicted_px: (N, 2).
        radius_px: (N,) half sides of the windows.
        min_contrast: Templates with a smaller standard deviation are passed over.

    Returns:
        Positions to a fraction of a pixel, by a parabola through the highest value and its neighbours.
    """
    count, side = len(templates), templates.shape[1]
    half = side // 2
    uv, best = np.asarray(predicted_px, np.float64).copy(), np.full(count, -1.0)
    centre = np.round(np.nan_to_num(predicted_px, nan=-1e6)).astype(np.int64)
    reach = np.ceil(radius_px).astype(np.int64)[:, None]
    low = np.maximum(centre - reach - half, 0)
    high = np.minimum(centre + reach + half + 1, np.array(image.shape[::-1]))
    possible = (high - low >= side).all(axis=1) & (templates.std(axis=(1, 2)) >= max(min_contrast, 1e-3))
    for i in np.flatnonzero(possible):
        window = image[low[i, 1] : high[i, 1], low[i, 0] : high[i, 0]]
        score = np.asarray(cv2.matchTemplate(window, templates[i], cv2.TM_CCOEFF_NORMED), np.float32)
        _, best[i], _, (x, y) = cv2.minMaxLoc(score)
        uv[i] = low[i] + half + (x, y) + _peak(score, x, y)
    return Matches(uv, best)


def _peak(score: Float32Array, x: int, y: int) -> FloatArray:
    """(2,) how far the top lies from the highest value, each axis by a parabola; 0 at the border."""
    shift = np.zeros(2)
    if 0 < x < score.shape[1] - 1:
        shift[0] = _parabola(*score[y, x - 1 : x + 2].tolist())
    if 0 < y < score.shape[0] - 1:
        shift[1] = _parabola(*score[y - 1 : y + 2, x].tolist())
    return shift


def _parabola(before: float, middle: float, after: float) -> float:
    bend = before + after - 2 * middle
    return 0.5 * (before - after) / bend if bend < -1e-9 else 0.0

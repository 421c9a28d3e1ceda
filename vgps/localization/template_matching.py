"""Template matching by normalised cross-correlation, (D) of Matsuda 2007."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from vgps.model import Float32Array, FloatArray, IntArray

_BATCH_RADIUS = 5  # half side up to which all windows at once are faster than OpenCV one by one
_MIN_ENERGY = 1e-2  # sum of squared deviations of a window's grey values


@dataclass(frozen=True)
class TemplateMatches:
    """Positions of highest correlation.

    Attributes:
        uv_px: (N, 2).
        correlation: (N,); -1 where a template was not searched.
    """

    uv_px: FloatArray
    correlation: FloatArray


def match_templates(
    image: Float32Array,
    templates: Float32Array,
    predicted_px: FloatArray,
    radius_px: FloatArray,
    min_contrast: float = 0.0,
) -> TemplateMatches:
    """Find the highest normalised cross-correlation in a window around each prediction.

    Args:
        image: (H, W) grey, float32.
        templates: (N, M, M), M odd.
        predicted_px: (N, 2).
        radius_px: (N,) half sides of the windows.
        min_contrast: Templates with a smaller standard deviation are not searched.

    Returns:
        Positions with subpixel precision, by a parabola through the highest value and its neighbours.
    """
    count, side = len(templates), templates.shape[1]
    half = side // 2
    best = np.full(count, -1.0)
    centre = np.round(np.nan_to_num(predicted_px, nan=-1e6)).astype(np.int64)
    reach = np.ceil(radius_px).astype(np.int64)
    low = np.maximum(centre - reach[:, None] - half, 0)
    high = np.minimum(centre + reach[:, None] + half + 1, np.array(image.shape[::-1]))
    size = high - low
    contrast = np.std(templates.reshape(count, -1), axis=1)
    possible = (size >= side).all(axis=1) & (contrast >= max(min_contrast, 1e-3))
    complete = possible & (size == side + 2 * reach[:, None]).all(axis=1)
    top, near = np.zeros((count, 2), np.int64), np.full((count, 3, 3), np.nan, np.float32)
    for r in np.unique(reach[complete & (reach <= _BATCH_RADIUS)]):
        rows = np.flatnonzero(complete & (reach == r))
        scores = cross_correlations(_windows(image, low[rows], side + 2 * r), templates[rows])
        best[rows], top[rows], near[rows] = _highest(scores)
    for i in np.flatnonzero(possible & ~(complete & (reach <= _BATCH_RADIUS))):
        window = image[low[i, 1] : high[i, 1], low[i, 0] : high[i, 0]]
        best[i], top[i], near[i] = _highest_in(window, templates[i])
    found = low + half + top + _peak(near)
    return TemplateMatches(np.where(possible[:, None], found, predicted_px), best)


def _highest_in(window: Float32Array, template: Float32Array) -> tuple[float, tuple[int, int], Float32Array]:
    """As :func:`_highest`, for one template in a window of any size."""
    score = cv2.matchTemplate(window, template, cv2.TM_CCOEFF_NORMED)
    _, best, _, (u, v) = cv2.minMaxLoc(score)
    framed = cv2.copyMakeBorder(score, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=np.nan)
    return best, (u, v), np.asarray(framed[v : v + 3, u : u + 3], np.float32)


def _windows(image: Float32Array, low: IntArray, side: int) -> Float32Array:
    """Return windows (N, side, side) of the image at upper left corners (N, 2)."""
    return np.asarray(sliding_window_view(image, (side, side))[low[:, 1], low[:, 0]])


def cross_correlations(windows: Float32Array, templates: Float32Array) -> Float32Array:
    """Return normalised cross-correlations of templates (N, M, M) at every position in windows (N, S, S).

    Returns:
        (N, S - M + 1, S - M + 1).
    """
    count, side = templates.shape[:2]
    places = windows.shape[1] - side + 1
    # without their means, sums of squares keep their precision
    windows = windows - windows.mean(axis=(1, 2), keepdims=True)
    templates = templates - templates.mean(axis=(1, 2), keepdims=True)
    stripes = sliding_window_view(windows, side, axis=2).transpose(0, 2, 1, 3).reshape(count, places, -1)
    # a stripe holds columns u to u + M of the window; its rows v to v + M are contiguous
    parts = sliding_window_view(stripes, side**2, axis=2)[:, :, ::side]
    products = np.einsum("nuvk,nk->nvu", parts, templates.reshape(count, -1))
    window = _window_sums(windows.shape[1], side)
    exact = windows.astype(np.float64)
    sums, squares = (window.T @ (values @ window) for values in (exact, exact**2))
    energy = np.einsum("nij,nij->n", templates, templates)[:, None, None]
    spread = np.maximum(squares - sums**2 / side**2, _MIN_ENERGY)
    return np.asarray(products / np.sqrt(spread * energy), np.float32)


@cache
def _window_sums(length: int, side: int) -> FloatArray:
    """Return a matrix (length, length - side + 1) that sums ``side`` successive values."""
    place = np.arange(length)[:, None] - np.arange(length - side + 1)
    return ((place >= 0) & (place < side)).astype(np.float64)


def _highest(scores: Float32Array) -> tuple[Float32Array, IntArray, Float32Array]:
    """Return the highest of scores (N, H, W), its position (u, v) (N, 2), and its neighbourhood (N, 3, 3)."""
    count, _, width = scores.shape
    row = np.arange(count)
    v, u = np.divmod(scores.reshape(count, -1).argmax(axis=1), width)
    padded = np.pad(scores, ((0, 0), (1, 1), (1, 1)), constant_values=np.nan)
    near = sliding_window_view(padded, (3, 3), axis=(1, 2))[row, v, u]
    return scores[row, v, u], np.stack([u, v], axis=1), near


def _peak(near: Float32Array) -> FloatArray:
    """Return offsets (N, 2) from the highest value to the peak of a parabola per axis; 0 at the border.

    Args:
        near: (N, 3, 3) neighbourhood of the highest value; NaN beyond the border.
    """
    middle = near[:, 1, 1].astype(np.float64)
    ends = np.stack([near[:, 1, [0, 2]], near[:, [0, 2], 1]], axis=1).astype(np.float64)
    bend = ends.sum(axis=2) - 2 * middle[:, None]
    sharp = bend < -1e-9
    return np.where(sharp, 0.5 * (ends[:, :, 0] - ends[:, :, 1]) / np.where(sharp, bend, -1.0), 0.0)

"""Where features may begin: local maxima of the Harris operator (A-1), spread over the image."""

import cv2
import numpy as np

from vgps.config import TrackingConfig
from vgps.model import FloatArray, GrayImage

_BLOCK_PX = 3
_MARGIN_PX = 10


def harris_maxima(gray: GrayImage, config: TrackingConfig) -> tuple[FloatArray, FloatArray]:
    """All local maxima of the Harris response (A-1, Kume 2010), strongest first.

    Args:
        gray: (H, W) image.
        config: ``harris_k`` and ``harris_quality``, the share of the strongest response to exceed.

    Returns:
        ``uv_px`` (N, 2) and their responses (N,).
    """
    response = cv2.cornerHarris(gray, _BLOCK_PX, 3, config.harris_k)
    inner = slice(_MARGIN_PX, -_MARGIN_PX)
    least = max(config.harris_quality * cv2.minMaxLoc(response)[1], 1e-12)
    largest = cv2.dilate(response, np.ones((3, 3), np.uint8))
    peak = (response == largest)[inner, inner] & (response > least)[inner, inner]
    rows, columns = np.divmod(np.flatnonzero(peak), peak.shape[1])
    rows, columns = rows + _MARGIN_PX, columns + _MARGIN_PX
    strength = response[rows, columns].astype(np.float64)
    order = np.argsort(-strength, kind="stable")
    return np.stack([columns, rows], axis=1)[order].astype(np.float64), strength[order]


def new_corners(
    gray: GrayImage, taken_uv_px: FloatArray, wanted: int, config: TrackingConfig, rng: np.random.Generator
) -> FloatArray:
    """Corners to follow from this frame on, away from those already followed.

    The strongest corner of every empty cell of a grid is a candidate; of these the ``wanted`` are drawn at
    random, so that features cover the image rather than its one well-textured corner.

    Args:
        gray: (H, W) image.
        taken_uv_px: (N, 2) features already followed.
        wanted: At most this many are returned.
        config: Cell size is ``min_distance_px``.
        rng: Source of the draw.

    Returns:
        (M, 2) pixels, M <= wanted.
    """
    if wanted <= 0:
        return np.zeros((0, 2))
    uv, _ = harris_maxima(gray, config)
    height, width = gray.shape
    cell = config.min_distance_px
    columns = int(np.ceil(width / cell))
    blocked = np.zeros((int(np.ceil(height / cell)) + 2, columns + 2), dtype=np.uint8)
    taken = (taken_uv_px / cell).astype(int) + 1
    inside = np.all((taken > 0) & (taken <= (columns, blocked.shape[0] - 2)), axis=1)
    blocked[taken[inside, 1], taken[inside, 0]] = 1
    at = (uv / cell).astype(int) + 1
    free = blocked[at[:, 1], at[:, 0]] == 0
    uv, at = uv[free], at[free]
    _, first = np.unique(at[:, 1] * blocked.shape[1] + at[:, 0], return_index=True)
    candidates: FloatArray = uv[np.sort(first)]
    if len(candidates) <= wanted:
        return candidates
    drawn = np.sort(rng.choice(len(candidates), wanted, replace=False))
    return np.asarray(candidates[drawn])

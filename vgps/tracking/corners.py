"""New features: local maxima of the Harris operator (A-1), spread over the image."""

import cv2
import numpy as np

from vgps.config import TrackingConfig
from vgps.model import BoolArray, FloatArray, GrayImage

_BLOCK_PX = 3  # over which Harris sums the products of gradients
_MARGIN_PX = 10  # a patch nearer to the border would leave the image


def harris_maxima(gray: GrayImage, config: TrackingConfig) -> tuple[FloatArray, FloatArray]:
    """Return all local maxima of the Harris response (A-1, Kume 2010), strongest first.

    Args:
        gray: (H, W) image.
        config: Gives ``harris_k`` and ``harris_quality``.

    Returns:
        Pixels (N, 2) and responses (N,).
    """
    pixels, strength = _maxima(gray, config)
    order = np.argsort(-strength, kind="stable")
    return pixels[order], strength[order]


def _maxima(gray: GrayImage, config: TrackingConfig) -> tuple[FloatArray, FloatArray]:
    """Return all local maxima of the Harris response, pixels (N, 2) and responses (N,), row by row."""
    response = cv2.cornerHarris(gray, _BLOCK_PX, 3, config.harris_k)
    inner = slice(_MARGIN_PX, -_MARGIN_PX)
    threshold = max(config.harris_quality * cv2.minMaxLoc(response)[1], 1e-12)
    largest = cv2.dilate(response, np.ones((3, 3), np.uint8))
    peak = (response == largest)[inner, inner] & (response > threshold)[inner, inner]
    rows, columns = np.divmod(np.flatnonzero(peak), peak.shape[1])
    rows, columns = rows + _MARGIN_PX, columns + _MARGIN_PX
    return np.stack([columns, rows], axis=1).astype(np.float64), response[rows, columns].astype(np.float64)


def new_corners(
    gray: GrayImage,
    followed_uv_px: FloatArray,
    count: int,
    config: TrackingConfig,
    rng: np.random.Generator,
    mask: BoolArray | None = None,
) -> FloatArray:
    """Return corners (M, 2) to follow from this frame on, M <= ``count``.

    Candidates are the strongest corners of the cells of a grid in which no feature is followed. They are
    drawn at random, so that features cover the whole image rather than its best-textured part.

    Args:
        gray: (H, W) image.
        followed_uv_px: (N, 2) features already followed.
        count: Maximum number of corners.
        config: Gives the side of a cell, ``min_distance_px``.
        rng: Random generator for the draw.
        mask: (H, W) where corners are wanted; None for everywhere.
    """
    if count <= 0:
        return np.zeros((0, 2))
    uv, strength = _maxima(gray, config)
    height, width = gray.shape
    cell = config.min_distance_px
    columns = int(np.ceil(width / cell))
    occupied = np.zeros((int(np.ceil(height / cell)) + 2, columns + 2), dtype=bool)
    followed = (followed_uv_px / cell).astype(int) + 1
    inside = np.all((followed > 0) & (followed <= (columns, occupied.shape[0] - 2)), axis=1)
    occupied[followed[inside, 1], followed[inside, 0]] = True
    cells = (uv / cell).astype(int) + 1
    free = np.flatnonzero(~occupied[cells[:, 1], cells[:, 0]] & is_shown(mask, uv))
    free = free[np.argsort(-strength[free], kind="stable")]
    _, first = np.unique(cells[free, 1] * occupied.shape[1] + cells[free, 0], return_index=True)
    candidates: FloatArray = uv[free[np.sort(first)]]
    if len(candidates) <= count:
        return candidates
    drawn = np.sort(rng.choice(len(candidates), count, replace=False))
    return np.asarray(candidates[drawn])


def is_shown(mask: BoolArray | None, uv_px: FloatArray) -> BoolArray:
    """Return whether a mask (H, W) shows the scene at pixels (N, 2); true outside it and without one."""
    shown = np.ones(len(uv_px), dtype=bool)
    if mask is None:
        return shown
    near = np.clip(np.nan_to_num(uv_px, nan=-1.0), -1.0, max(mask.shape))  # far outside is no integer
    column, row = np.rint(near).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < mask.shape[1]) & (row < mask.shape[0])
    shown[inside] = mask[row[inside], column[inside]]
    return shown

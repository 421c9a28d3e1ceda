"""Motion blur of templates: uniform motion along a line, one per template; (C) of Matsuda 2007."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from vgps.model import Float32Array, FloatArray


@dataclass(frozen=True, kw_only=True)
class BlurGrids:
    """Sampling grids of templates with rows along the motion, so that blur is a mean along rows.

    Attributes:
        image_R_grid: (N, 2, 2) steps in the image of one column, which is along the motion, and of one row.
        length_px: (N,) length of the motion; 1 where it is too short to blur a template.
        height, width: Of every grid, both odd; its centre is the template's.
        side: Of the templates, odd.
    """

    image_R_grid: FloatArray
    length_px: FloatArray
    height: int
    width: int
    side: int


def blur_grids(blur_px: FloatArray, side: int) -> BlurGrids:
    """Return sampling grids for templates of a side, given image motions (N, 2) during the exposure."""
    length = np.linalg.norm(blur_px, axis=1)
    sharp = length <= 1.0
    along = np.where(sharp[:, None], (1.0, 0.0), blur_px / np.maximum(length, 1.0)[:, None])
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    corner = side // 2 * np.sqrt(2)
    length = np.maximum(length, 1.0)
    height = 2 * int(np.ceil(corner)) + 3
    width = 2 * int(np.ceil(corner + length.max(initial=1.0) / 2)) + 3
    return BlurGrids(
        image_R_grid=np.stack([along, across], axis=2),
        length_px=length,
        height=height,
        width=width,
        side=side,
    )


@cache
def pixel_offsets(height: int, width: int) -> Float32Array:
    """Return columns and rows (2, height * width) of a grid's pixels, relative to its centre."""
    row, column = np.mgrid[:height, :width].reshape(2, -1).astype(np.float32)
    return np.stack([column - width // 2, row - height // 2])


def blur_along_rows(sampled: Float32Array, grids: BlurGrids) -> Float32Array:
    """Return templates whose pixels are means over the motion.

    Args:
        sampled: (N, height, width) grey values on the grids.
        grids: The grids.

    Returns:
        (N, side, side), aligned with the image.
    """
    count, height, width = sampled.shape
    level = sampled.mean(axis=(1, 2), keepdims=True)
    integral = np.zeros((count, height, width + 1), np.float32)
    np.cumsum(sampled - level, axis=2, out=integral[:, :, 1:])
    pixels = pixel_offsets(grids.side, grids.side)
    along, across = (grids.image_R_grid[:, :, k].astype(np.float32) @ pixels for k in (0, 1))
    # column j of the integral is the sum up to the left border of pixel j
    column = along + np.float32(width / 2)
    row = across + (height // 2 + height * np.arange(count, dtype=np.float32)[:, None])
    length = grids.length_px[:, None].astype(np.float32)
    end, start = (
        cv2.remap(integral.reshape(-1, width + 1), at, row, cv2.INTER_LINEAR)
        for at in (column + length / 2, column - length / 2)
    )
    means = (end - start) / length + level[:, 0]
    return np.asarray(means.reshape(count, grids.side, grids.side), np.float32)

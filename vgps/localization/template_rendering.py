"""Rendering of templates as a predicted camera sees them: planes warped to the image, at a fitting level."""

from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from vgps.geometry import MIN_DEPTH
from vgps.landmarks.model import LandmarkViews
from vgps.localization.motion_blur import BlurGrids, blur_along_rows, blur_grids, pixel_offsets
from vgps.model import Float32Array, FloatArray

_BATCH = 60  # templates sampled at once: fits the processor's cache, and OpenCV's limit of 32,000 rows


def plane_to_image(K: FloatArray, world_T_camera: FloatArray, views: LandmarkViews) -> FloatArray:
    """Return the image motion (u, v) per template pixel (column, row) at level 0, as matrices (N, 2, 2)."""
    rotation = world_T_camera[:3, :3]
    camera_p = (views.world_p_landmark - world_T_camera[:3, 3]) @ rotation
    x, y, z = camera_p[:, 0], camera_p[:, 1], np.maximum(camera_p[:, 2], MIN_DEPTH)
    axes = np.stack([views.world_v_column @ rotation, views.world_v_row @ rotation], axis=-1)
    u = K[0, 0] * (axes[:, 0] - (x / z)[:, None] * axes[:, 2]) / z[:, None]
    v = K[1, 1] * (axes[:, 1] - (y / z)[:, None] * axes[:, 2]) / z[:, None]
    return np.stack([u, v], axis=1)


def render_templates(
    K: FloatArray, world_T_camera: FloatArray, views: LandmarkViews, blur_px: FloatArray, side: int
) -> Float32Array:
    """Warp templates by the axes of their planes to a camera, then blur them by the motion: (B) to (D).

    Args:
        K: (3, 3).
        world_T_camera: (4, 4) predicted.
        views: N views.
        blur_px: (N, 2) image motion during the exposure; zero leaves them sharp.
        side: Of a template in the image, odd.

    Returns:
        (N, side, side) grey values, centred on the landmarks.
    """
    image_to_plane = np.asarray(np.linalg.inv(plane_to_image(K, world_T_camera, views)), np.float64)
    out = np.empty((len(views), side, side), np.float32)
    for begin in range(0, len(views), _BATCH):
        rows = slice(begin, begin + _BATCH)
        grids = blur_grids(blur_px[rows], side)
        grid_to_plane = image_to_plane[rows] @ grids.image_R_grid
        planes = _mosaics(views.templates[rows], grid_to_plane, grids)
        out[rows] = blur_along_rows(_sample(planes, grid_to_plane, grids), grids)
    return out


def _sample(planes: Float32Array, grid_to_plane: FloatArray, grids: BlurGrids) -> Float32Array:
    """Return grey values (N, height, width) of planes (N, C, C) on the grids; edges are repeated."""
    count, size = planes.shape[:2]
    half = np.float32(size // 2)
    grid = pixel_offsets(grids.height, grids.width)
    x, y = (grid_to_plane[:, axis].astype(np.float32) @ grid for axis in (0, 1))
    # the planes are stacked into one picture: OpenCV repeats its sides, the clipping the edges in between
    np.clip(y, -half, half, out=y)
    y += half + size * np.arange(count, dtype=np.float32)[:, None]
    x += half
    tiles = planes.reshape(-1, size)
    out = cv2.remap(tiles, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(out.reshape(count, grids.height, grids.width), np.float32)


def _mosaics(stored: npt.NDArray[np.uint8], grid_to_plane: FloatArray, grids: BlurGrids) -> Float32Array:
    """Return one picture (N, C, C) per plane at the resolution of level 0, coarse levels around finer ones.

    A level is used if it is no finer than the image; coarser ones fill its surroundings as far as the grids
    reach.
    """
    levels, side = stored.shape[1:3]
    step = np.sqrt(np.abs(np.linalg.det(grid_to_plane)))
    finest = np.round(np.log2(np.maximum(step, 1e-6)))
    reach = np.abs(grid_to_plane) @ np.array([grids.width / 2, grids.height / 2])
    needed = max(np.log2(reach.max() / (side // 2)), finest.max())
    coarsest = int(np.clip(np.ceil(needed), 0, levels - 1))
    out = _enlarged(stored[:, coarsest], coarsest)
    for level in range(coarsest - 1, -1, -1):
        serves = np.flatnonzero(finest <= level)
        rim = (out.shape[1] - (side - 1) * 2**level - 1) // 2
        inner = slice(rim, out.shape[1] - rim)
        out[serves, inner, inner] = _enlarged(stored[serves, level], level)
    return out


def _enlarged(tiles: npt.NDArray[np.uint8], level: int) -> Float32Array:
    """Return tiles (N, P, P) enlarged by ``2**level``, linearly between pixel centres."""
    if level == 0:
        return tiles.astype(np.float32)
    by = _enlargement(tiles.shape[1], level)
    return np.asarray(by @ (tiles.astype(np.float32) @ by.T), np.float32)


@cache
def _enlargement(side: int, level: int) -> Float32Array:
    """Return the weights (M, side) of a row's pixels at ``2**level`` positions per pixel."""
    at = np.arange((side - 1) * 2**level + 1) / 2**level
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(at[:, None] - np.arange(side))), np.float32)

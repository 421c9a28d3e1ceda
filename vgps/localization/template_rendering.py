"""Templates as the predicted camera will see them: each plane warped to the image, at the fitting level."""

from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from vgps.geometry import MIN_DEPTH
from vgps.landmarks.model import LandmarkViews
from vgps.localization.motion_blur import BlurGrids, blur_along_rows, blur_grids, pixel_offsets
from vgps.model import Float32Array, FloatArray

_BLOCK = 60  # so many are sampled at once: what stays in the cache is faster, and OpenCV takes 32,000 lines


def plane_to_image(K: FloatArray, world_T_camera: FloatArray, views: LandmarkViews) -> FloatArray:
    """(N, 2, 2) how a step of one template pixel (column, row) at level 0 moves in the image (u, v)."""
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
    """Templates warped by their plane's axes to a camera, then blurred by the motion: (B) to (D).

    Args:
        K: (3, 3).
        world_T_camera: (4, 4) predicted.
        views: N of them.
        blur_px: (N, 2) motion in the image while the shutter is open; zero leaves them sharp.
        side: Of a template in the image, odd.

    Returns:
        (N, side, side) grey values; a template's middle is the landmark.
    """
    image_to_plane = np.asarray(np.linalg.inv(plane_to_image(K, world_T_camera, views)), np.float64)
    out = np.empty((len(views), side, side), np.float32)
    for begin in range(0, len(views), _BLOCK):
        rows = slice(begin, begin + _BLOCK)
        grids = blur_grids(blur_px[rows], side)
        grid_to_plane = image_to_plane[rows] @ grids.image_R_grid
        planes = _planes(views.templates[rows], grid_to_plane, grids)
        out[rows] = blur_along_rows(_sampled(planes, grid_to_plane, grids), grids)
    return out


def _sampled(planes: Float32Array, grid_to_plane: FloatArray, grids: BlurGrids) -> Float32Array:
    """(N, height, width) grey values of planes (N, C, C) on the grids; edges are repeated."""
    count, size = planes.shape[:2]
    half = np.float32(size // 2)
    grid = pixel_offsets(grids.height, grids.width)
    x, y = (grid_to_plane[:, axis].astype(np.float32) @ grid for axis in (0, 1))
    # the planes below each other as one picture, whose sides OpenCV repeats, and we what is between them
    np.clip(y, -half, half, out=y)
    y += half + size * np.arange(count, dtype=np.float32)[:, None]
    x += half
    tiles = planes.reshape(-1, size)
    out = cv2.remap(tiles, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(out.reshape(count, grids.height, grids.width), np.float32)


def _planes(stored: npt.NDArray[np.uint8], grid_to_plane: FloatArray, grids: BlurGrids) -> Float32Array:
    """(N, C, C) one picture of each plane, a pixel for a pixel of level 0: coarse levels around finer ones.

    A level serves where it is no finer than the image; coarser ones reach farther and fill the
    surroundings, as far as the grids reach.
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
    """Tiles (N, P, P) with ``2**level`` pixels for one, linearly between their middles."""
    if level == 0:
        return tiles.astype(np.float32)
    by = _between(tiles.shape[1], level)
    return np.asarray(by @ (tiles.astype(np.float32) @ by.T), np.float32)


@cache
def _between(side: int, level: int) -> Float32Array:
    """(M, side) weights of a row's pixels at ``2**level`` places for one."""
    at = np.arange((side - 1) * 2**level + 1) / 2**level
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(at[:, None] - np.arange(side))), np.float32)

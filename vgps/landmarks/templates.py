"""Templates as the predicted camera will see them: each plane warped to the image, at the fitting level."""

import cv2
import numpy as np
import numpy.typing as npt

from vgps.geometry import MIN_DEPTH
from vgps.landmarks.blur import Float32Array, blur_margin, blur_patches
from vgps.landmarks.views import LandmarkViews
from vgps.model import FloatArray

_BLOCK = 16  # so many are sampled at once: what stays in the cache is a third faster


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
    margin = blur_margin(blur_px) if np.any(blur_px) else 0
    patches = np.empty((len(views), side + 2 * margin, side + 2 * margin), np.float32)
    for begin in range(0, len(views), _BLOCK):
        rows = slice(begin, begin + _BLOCK)
        patches[rows] = _sample(views.templates[rows], image_to_plane[rows], side + 2 * margin)
    return blur_patches(patches, blur_px, side) if margin else patches


def _sample(stored: npt.NDArray[np.uint8], image_to_plane: FloatArray, side: int) -> Float32Array:
    """(N, side, side) grey values around each landmark.

    A level serves where it is no finer than the image; coarser ones reach farther and fill the
    surroundings.
    """
    count, levels, p = stored.shape[:3]
    half = p // 2
    offset = np.arange(side, dtype=np.float32) - side // 2
    by = image_to_plane.astype(np.float32)[:, :, :, None, None]
    column = by[:, 0, 0] * offset[None, :] + by[:, 0, 1] * offset[:, None]
    row = by[:, 1, 0] * offset[None, :] + by[:, 1, 1] * offset[:, None]
    step = np.sqrt(np.abs(np.linalg.det(image_to_plane)))
    finest = np.clip(np.round(np.log2(np.maximum(step, 1e-6))), 0, levels - 1).astype(np.int8)
    reach = np.maximum(np.abs(column), np.abs(row))
    level = np.zeros(reach.shape, np.int8)
    for k in range(levels - 1):
        level += reach > half * 2**k
    level = np.maximum(level, finest[:, None, None])
    shrink = (0.5 ** np.arange(levels)).astype(np.float32)[level]
    # one atlas: a row of tiles for each view, a tile for each level
    atlas = np.ascontiguousarray(stored.transpose(0, 2, 1, 3).reshape(count * p, levels * p))
    x = np.clip(column * shrink, -half, half) + half + p * level
    y = np.clip(row * shrink, -half, half) + half + p * np.arange(count, dtype=np.float32)[:, None, None]
    flat = [np.ascontiguousarray(part.reshape(count, -1), np.float32) for part in (x, y)]
    sampled = cv2.remap(atlas.astype(np.float32), flat[0], flat[1], cv2.INTER_LINEAR)
    return np.asarray(sampled.reshape(count, side, side), np.float32)

"""Templates cut from a frame: patches parallel to the image around landmarks, at several scales.

(B) to (D) of Matsuda 2007. A pixel of level k samples the image smoothed for a step of ``2**k`` pixels.
"""

import cv2
import numpy as np
import numpy.typing as npt

from vgps.model import BoolArray, Camera, Float32Array, FloatArray

_MAX_ROWS = 32_000  # limit of OpenCV's remap
_SIGMA_PER_STEP = 0.5  # a Gaussian of half a step leaves little above the Nyquist frequency of the step


class Pyramid:
    """An undistorted frame, smoothed for each level but not reduced in size.

    Args:
        image: (H, W) undistorted.
        levels: Number of levels.
    """

    def __init__(self, image: Float32Array, levels: int) -> None:
        self._images = [image, *(_smoothed(image, 2**k) for k in range(1, levels))]

    def sample(self, uv_px: FloatArray, patch_px: int) -> npt.NDArray[np.uint8]:
        """Return patches (N, levels, P, P) around pixels (N, 2); the image's edge is repeated outside it."""
        offset = np.arange(patch_px) - patch_px // 2
        out = np.empty((len(uv_px), len(self._images), patch_px, patch_px), np.uint8)
        for level, image in enumerate(self._images):
            u, v = (uv_px[:, axis, None, None] + 2**level * offset for axis in (0, 1))
            u, v = np.broadcast_arrays(u, v.transpose(0, 2, 1))
            out[:, level] = np.round(_interpolated(image, u, v))
        return out


def _smoothed(image: Float32Array, step: int) -> Float32Array:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), _SIGMA_PER_STEP * step), np.float32)


def _interpolated(image: Float32Array, u: FloatArray, v: FloatArray) -> Float32Array:
    """Return bilinear samples at pixels (N, P, P)."""
    flat_u, flat_v = (axis.reshape(-1, axis.shape[-1]).astype(np.float32) for axis in (u, v))
    out = np.empty_like(flat_u)
    for i in range(0, len(out), _MAX_ROWS):
        part = slice(i, i + _MAX_ROWS)
        out[part] = cv2.remap(
            image, flat_u[part], flat_v[part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
    return out.reshape(u.shape)


def plane_axes(
    world_T_camera: FloatArray, camera: Camera, depth_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the world vectors of one pixel to the right and one down, for patches parallel to the image.

    Args:
        world_T_camera: (N, 4, 4).
        camera: Its focal lengths.
        depth_m: (N,) of the landmarks.

    Returns:
        ``world_v_column`` and ``world_v_row``, (N, 3) metres.
    """
    right, down = world_T_camera[:, :3, 0], world_T_camera[:, :3, 1]
    return depth_m[:, None] / camera.fx * right, depth_m[:, None] / camera.fy * down


def patch_in_image(uv_px: FloatArray, camera: Camera, patch_px: int) -> BoolArray:
    """Return whether each finest patch (N,) lies within the image; coarser ones may repeat its edge."""
    half = patch_px // 2
    inside = (uv_px >= half) & (uv_px <= (camera.width - 1 - half, camera.height - 1 - half))
    return np.asarray(inside.all(axis=1))

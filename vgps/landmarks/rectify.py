"""Images as a pinhole camera takes them."""

import cv2
import numpy as np

from vgps.camera import distort, in_pinhole
from vgps.model import Camera, Float32Array, GrayImage

_OUTSIDE = -1e4  # OpenCV's maps take no NaN


def pinhole_maps(pinhole: Camera, source: Camera) -> tuple[Float32Array, Float32Array]:
    """Return u and v (H, W) of every pixel of a pinhole camera in the image of another camera.

    They are maps for ``cv2.remap``, far outside the image where the lens has none.

    Args:
        pinhole: Its intrinsics; a lens model is ignored.
        source: The camera that took the image.
    """
    u, v = np.meshgrid(np.arange(float(pinhole.width)), np.arange(float(pinhole.height)))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    there = distort(source, in_pinhole(pixels, pinhole, source))
    x, y = np.nan_to_num(there, nan=_OUTSIDE).astype(np.float32).T.reshape(2, *u.shape)
    return x.copy(), y.copy()


class Rectifier:
    """Undistorts images of one camera to the same K and size; pixels outside the lens's image are black."""

    def __init__(self, camera: Camera) -> None:
        self._maps = None if camera.model == "pinhole" else pinhole_maps(camera, camera)

    def __call__(self, gray: GrayImage) -> Float32Array:
        """Return the undistorted image (H, W), float32."""
        image = gray.astype(np.float32)
        if self._maps is None:
            return image
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), np.float32)

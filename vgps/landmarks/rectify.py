"""Undistortion of images to those of a pinhole camera of the same K and size."""

import cv2
import numpy as np

from vgps.camera import distort
from vgps.model import Camera, Float32Array, GrayImage


class Rectifier:
    """Undistorts images of one camera; pixels outside the lens's image are black."""

    def __init__(self, camera: Camera) -> None:
        self._maps: tuple[Float32Array, Float32Array] | None = None
        if camera.model != "pinhole":
            u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
            source = distort(camera, np.column_stack([u.ravel(), v.ravel()]))
            outside = -1e4  # OpenCV's maps take no NaN
            maps = np.nan_to_num(source, nan=outside).astype(np.float32).T.reshape(2, *u.shape)
            self._maps = maps[0].copy(), maps[1].copy()

    def __call__(self, gray: GrayImage) -> Float32Array:
        """Return the undistorted image (H, W), float32."""
        image = gray.astype(np.float32)
        if self._maps is None:
            return image
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), np.float32)

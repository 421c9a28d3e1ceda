"""Images of different cameras as one pinhole camera shows them, so that they can be compared."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import cv2
import numpy as np

from vgps.camera import distort, in_pinhole
from vgps.model import Camera, Float32Array, Frame, GrayImage

_OUTSIDE = -1e4  # OpenCV's maps take no NaN


def seen_by(camera: Camera, source: Camera, frames: Iterable[Frame], first: int) -> Iterator[Frame]:
    """Yield frames as a pinhole camera shows them, numbered from ``first`` on.

    Args:
        camera: The pinhole camera.
        source: The camera that took the frames.
        frames: The frames.
        first: Number of the first one.
    """
    maps = _maps(camera, source)
    for frame in frames:
        yield replace(frame, index=first + frame.index, gray=_shown(frame.gray, maps), mask=None)


def _maps(camera: Camera, source: Camera) -> tuple[Float32Array, Float32Array]:
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.column_stack([u.ravel(), v.ravel()]).astype(np.float64)
    there = distort(source, in_pinhole(pixels, camera, source))
    x, y = np.nan_to_num(there, nan=_OUTSIDE).astype(np.float32).T.reshape(2, *u.shape)
    return x.copy(), y.copy()


def _shown(gray: GrayImage, maps: tuple[Float32Array, Float32Array]) -> GrayImage:
    return np.asarray(cv2.remap(gray, *maps, cv2.INTER_LINEAR), np.uint8)

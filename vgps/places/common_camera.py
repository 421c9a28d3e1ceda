"""Images of different cameras as one pinhole camera shows them, so that they can be compared."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import cv2
import numpy as np

from vgps.landmarks.rectify import pinhole_maps
from vgps.model import Camera, Frame


def seen_by(camera: Camera, source: Camera, frames: Iterable[Frame], first: int) -> Iterator[Frame]:
    """Yield frames as a pinhole camera shows them, numbered from ``first`` on.

    Args:
        camera: The pinhole camera.
        source: The camera that took the frames.
        frames: The frames.
        first: Number of the first one.
    """
    maps = pinhole_maps(camera, source)
    for frame in frames:
        gray = np.asarray(cv2.remap(frame.gray, *maps, cv2.INTER_LINEAR), np.uint8)
        mask = frame.mask
        if mask is not None:
            mask = cv2.remap(mask.astype(np.uint8), *maps, cv2.INTER_NEAREST) > 0
        yield replace(frame, index=first + frame.index, gray=gray, mask=mask)

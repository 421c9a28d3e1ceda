"""Images as floats, each converted once although two stages of tracking need it: as frame, then as view."""

import numpy as np

from vgps.model import Float32Array, GrayImage


class FloatImages:
    """The newest image as floats."""

    def __init__(self) -> None:
        self._newest: tuple[GrayImage, Float32Array] | None = None

    def of(self, gray: GrayImage) -> Float32Array:
        """Return an image (H, W) as floats."""
        if self._newest is None or self._newest[0] is not gray:
            self._newest = gray, gray.astype(np.float32)
        return self._newest[1]

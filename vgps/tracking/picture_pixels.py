"""Where projections lie in the picture as it was taken."""

import numpy as np

from vgps.camera import distort
from vgps.model import BoolArray, Camera, FloatArray

_MIN_DEPTH = 1e-3  # map units, of a point whose projection predicts where to search


def to_picture(
    camera: Camera, uv_px: FloatArray, depth: FloatArray, margin_px: float = 0.0
) -> tuple[FloatArray, BoolArray]:
    """Return the distorted pixels (N, 2) of projections, and whether each lies in the picture (N,).

    Args:
        camera: The lens.
        uv_px, depth: (N, 2) and (N,), from :func:`vgps.geometry.project`.
        margin_px: How far from the border of the picture.
    """
    raw = distort(camera, uv_px)
    limit = np.array([camera.width, camera.height]) - margin_px
    inside = np.all(np.isfinite(raw) & (raw > margin_px) & (raw < limit), axis=1)
    return raw, np.asarray((depth > _MIN_DEPTH) & inside)

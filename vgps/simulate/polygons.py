"""Convex polygons in the camera frame, cut to the view."""

import numpy as np

from vgps.model import FloatArray

NEAR_M = 0.15
Plane = tuple[float, float, float]
Polygon = list[tuple[float, float, float]]


def frustum(K: FloatArray, width: float, height: float) -> FloatArray:
    """Return (5, 3) inward normals of the view's sides, a pixel wider than the image, and the view axis."""
    f, cx, cy = K[0, 0], K[0, 2], K[1, 2]
    return np.array([[f, 0, cx + 1], [-f, 0, width - cx], [0, f, cy + 1], [0, -f, height - cy], [0, 0, 1.0]])


def clipped(polygon: Polygon, planes: tuple[Plane, ...]) -> Polygon:
    """Return the part of a polygon within the view."""
    for k, plane in enumerate(planes):
        polygon = cut(polygon, plane, NEAR_M if k == len(planes) - 1 else 0.0)
        if not polygon:
            break
    return polygon


def cut(polygon: Polygon, normal: Plane, least: float) -> Polygon:
    """Return the part of a convex polygon with ``normal . p >= least`` (Sutherland and Hodgman 1974)."""
    a, b, c = normal
    heights = [a * x + b * y + c * z - least for x, y, z in polygon]
    kept: Polygon = []
    for k, (p, h) in enumerate(zip(polygon, heights, strict=True)):
        q, g = polygon[k - 1], heights[k - 1]
        if (h >= 0) != (g >= 0):
            s = g / (g - h)
            kept.append((q[0] + s * (p[0] - q[0]), q[1] + s * (p[1] - q[1]), q[2] + s * (p[2] - q[2])))
        if h >= 0:
            kept.append(p)
    return kept

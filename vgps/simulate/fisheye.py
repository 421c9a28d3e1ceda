"""An equidistant fisheye: a point is seen ``focal_px`` times its angle from the axis away from the centre."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from vgps.model import Float32Array, FloatArray
from vgps.simulate.polygons import Plane, Polygon, cut, frustum

_LEAST_COSINE = math.cos(math.radians(25.0))  # in a piece of a polygon: its edges are nearly straight
MAX_DEG = 170.0  # diagonal field of view; what lies closer to 90 degrees off the axis is not drawn


@dataclass(frozen=True)
class Fisheye:
    """A fisheye with its axis through ``centre_px`` (2,)."""

    focal_px: float
    centre_px: FloatArray

    @classmethod
    def of_diagonal(cls, degrees: float, width: int, height: int) -> "Fisheye":
        """Return the lens that sees this angle from corner to corner of a picture."""
        centre = np.array([width - 1, height - 1]) / 2
        return cls(float(np.hypot(width, height) / np.radians(degrees)), centre)

    def rays(self, uv_px: FloatArray) -> FloatArray:
        """Return x / z and y / z (..., 2) of pixels (..., 2)."""
        offset = uv_px - self.centre_px
        radius = np.maximum(np.linalg.norm(offset, axis=-1, keepdims=True), 1e-9)
        return np.asarray(offset * np.tan(radius / self.focal_px) / radius)

    def pixels(self, camera_p: FloatArray) -> FloatArray:
        """Return the pixels (n, 2) of points (n, 3) in the camera frame."""
        across = np.linalg.norm(camera_p[:, :2], axis=1)
        scale = self.focal_px * np.arctan2(across, camera_p[:, 2]) / np.maximum(across, 1e-9)
        return np.asarray(camera_p[:, :2] * scale[:, None] + self.centre_px)


@dataclass(frozen=True)
class RayGrid:
    """The rays x / z, y / z (H, W, 2) of all pixels of a canvas, and the lens that they come from."""

    lens: Fisheye
    rays: Float32Array

    def sides(self) -> FloatArray:
        """Return (5, 3) inward normals of a pyramid around the view, and the view axis."""
        low, high = self.rays.min(axis=(0, 1)), self.rays.max(axis=(0, 1))
        K = np.array([[1.0, 0.0, -low[0]], [0.0, 1.0, -low[1]], [0.0, 0.0, 1.0]])
        return frustum(K, *(high - low).tolist())

    def flat_at(self, uv_px: FloatArray) -> FloatArray:
        """Return the map (3, 3) from pixels (u, v, 1) to rays (x / z, y / z, 1) near a pixel."""
        height, width, _ = self.rays.shape
        u, v = np.clip(uv_px.astype(int), 0, (width - 2, height - 2)).tolist()
        corner = self.rays[v : v + 2, u : u + 2].astype(float)
        ray, by_u, by_v = corner[0, 0], corner[0, 1], corner[1, 0]
        A = np.column_stack([by_u - ray, by_v - ray])
        return np.vstack([np.column_stack([A, ray - A @ (u, v)]), [0.0, 0.0, 1.0]])


@lru_cache(maxsize=4)  # of instants that most frames share; others are many, and 10 MB each
def ray_grid(focal_px: float, centre_px: tuple[float, float], size: tuple[int, int]) -> RayGrid:
    """Return the rays of a canvas of this width and height."""
    lens = Fisheye(focal_px, np.array(centre_px))
    u, v = (np.arange(float(side)) for side in size)
    return RayGrid(lens, lens.rays(np.stack(np.meshgrid(u, v), axis=-1)).astype(np.float32))


def pieces(polygon: Polygon) -> Iterator[Polygon]:
    """Yield the pieces of a convex polygon, halved until each is seen under a small angle."""
    if not polygon:
        return
    lengths = [math.hypot(*p) for p in polygon]
    rays = [(x / n, y / n, z / n) for (x, y, z), n in zip(polygon, lengths, strict=True)]
    cosine, one, other = min((_dot(p, q), p, q) for p, q in combinations_with_replacement(rays, 2))
    if cosine > _LEAST_COSINE:
        yield polygon
        return
    x, y, z = (p - q for p, q in zip(one, other, strict=True))
    yield from pieces(cut(polygon, (x, y, z), 0.0))
    yield from pieces(cut(polygon, (-x, -y, -z), 0.0))


def _dot(p: Plane, q: Plane) -> float:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]

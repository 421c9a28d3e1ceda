"""Which landmarks a camera sees, which view of each suits it, and which to take where there are too many.

(B) of Matsuda 2007: project (4), keep what falls in the image.
"""

from dataclasses import dataclass
from functools import cache
from math import cos, radians, sqrt

import numpy as np

from vgps.config import SelectionConfig
from vgps.model import Camera, Float32Array, FloatArray, IntArray

MIN_DEPTH_M = 0.1
_FAR_M = 1e30  # for no limit at all, and for float32
_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


@dataclass(frozen=True)
class VisibleLandmarks:
    """Landmarks in the image: ``row`` (n,) of the points asked, ``uv_px`` (2, n), and ``pixel_m`` (n,) metres
    that a pixel of the camera covers there."""

    row: IntArray
    uv_px: Float32Array
    pixel_m: Float32Array

    def take(self, rows: IntArray) -> "VisibleLandmarks":
        """Some of them."""
        return VisibleLandmarks(self.row[rows], self.uv_px[:, rows], self.pixel_m[rows])


@dataclass(frozen=True)
class BestViews:
    """Of each candidate the view that suits best.

    Attributes:
        view: (n,) which one, -1 where none suits.
        cost: (n,) how far from the camera in direction and scale, 0 where it is just this camera's.
        sine: (n,) of the angle between the two directions.
    """

    view: IntArray
    cost: Float32Array
    sine: Float32Array

    def ranking_cost(
        self, pixel_m: Float32Array, sigma_px: FloatArray, position_sigma_m: FloatArray
    ) -> FloatArray:
        """(n,) the less, the better a match to expect.

        A position is uncertain along the rays that gave it, which shows as far as the camera leaves them.
        """
        shown_px = position_sigma_m * self.sine / pixel_m
        return np.asarray(np.hypot(sigma_px, shown_px) * (1 + self.cost))


def focal_px(camera: Camera) -> float:
    """One focal length for both axes: the geometric mean."""
    return sqrt(camera.fx * camera.fy)


@cache
def corner_cosine(camera: Camera) -> float:
    """Cosine of the angle between the optical axis and the ray of the image's furthest corner."""
    uv = _CORNERS * (camera.width, camera.height) - 0.5
    rays = (uv - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return float(1 / np.sqrt(1 + np.sum(rays**2, axis=1).max()))


@cache
def _sides(camera: Camera, max_depth_m: float | None) -> FloatArray:
    """(6, 4) that take (x, y, z, 1) in the camera frame to six measures, none negative if the image shows it.

    Pixels from the left and from the upper border, times the depth; depth beyond the least; pixels from the
    right and from the lower border, times the depth; depth short of the largest.
    """
    right, low = camera.width - 0.5, camera.height - 0.5
    of_pixels = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1], [-1, 0, right], [0, -1, low], [0, 0, -1]])
    limits = np.array([0, 0, -MIN_DEPTH_M, 0, 0, _FAR_M if max_depth_m is None else max_depth_m])
    return np.column_stack([of_pixels @ camera.K, limits])


def visible_landmarks(
    world_T_camera: FloatArray, camera: Camera, points: Float32Array, max_depth_m: float | None
) -> VisibleLandmarks:
    """Those of the points (4, N), a column (x, y, z, 1) each, that the camera's undistorted image shows."""
    # a row for each axis, not for each point: numpy is several times faster along rows
    of_camera = _sides(camera, max_depth_m)
    of_world = of_camera[:, :3] @ world_T_camera[:3, :3].T
    shift = of_camera[:, 3:] - of_world @ world_T_camera[:3, 3:]
    measures = np.hstack([of_world, shift]).astype(np.float32) @ points
    row = np.flatnonzero(measures.min(axis=0) >= 0)
    seen = measures[:3].take(row, axis=1)
    depth = seen[2] + np.float32(MIN_DEPTH_M)
    return VisibleLandmarks(row, seen[:2] / depth - np.float32(0.5), depth / np.float32(focal_px(camera)))


def best_views(
    to_camera: Float32Array, pixel_m: Float32Array, view_geometry: Float32Array, config: SelectionConfig
) -> BestViews:
    """The view of each landmark that is nearest to the camera in direction and in scale.

    Args:
        to_camera: (3, n) from the landmark to the camera, metres.
        pixel_m: (n,) metres that a pixel of the camera covers there.
        view_geometry: (n, 7, V) direction, normal and log2 of the pixel size of each view; NaN where there is
            none.
        config: What still suits.
    """
    if not len(view_geometry):
        return BestViews(np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros(0, np.float32))
    view_geometry = np.ascontiguousarray(view_geometry.transpose(1, 2, 0))  # long rows, as above
    direction = to_camera / np.sqrt(np.einsum("in,in->n", to_camera, to_camera))
    cosine, facing = np.einsum("kivn,in->kvn", view_geometry[:6].reshape(2, 3, -1, len(pixel_m)), direction)
    octaves = np.log2(pixel_m) - view_geometry[6]
    suits = cosine >= cos(radians(config.max_view_angle_deg))
    suits &= facing >= cos(radians(config.max_tilt_deg))
    suits &= (octaves >= -config.nearer_octaves) & (octaves <= config.further_octaves)
    cost = (2 / radians(config.angle_unit_deg) ** 2) * (1 - cosine) + (octaves / config.octave_unit) ** 2
    cost = np.where(suits, cost, np.float32(np.inf))
    view, least = cost.argmin(axis=0), cost.min(axis=0)
    sine = np.sqrt(np.maximum(1 - cosine[view, np.arange(len(view))] ** 2, 0))
    return BestViews(np.where(np.isfinite(least), view, -1), least, sine)


def spread_over_image(uv_px: Float32Array | FloatArray, size_px: tuple[int, int], count: int) -> IntArray:
    """Rows of the ``count`` to take: the first in every part of the image, then every part's second, ...

    Args:
        uv_px: (2, N), a column each, the best first.
        size_px: Width and height of the image, which is parted into about ``count`` squares.
        count: How many; all if there are no more.

    Returns:
        Rows in ascending order.
    """
    total = uv_px.shape[1]
    if total <= count:
        return np.arange(total)
    side = sqrt(size_px[0] * size_px[1] / max(count, 1))
    # there are hardly more squares than count; sixteen bits are sorted in linear time
    column, line = ((uv_px + 0.5) / side).astype(np.uint16 if count < 2**14 else np.uint32)
    part = line * (int(size_px[0] / side) + 1) + column
    by_part = np.argsort(part, kind="stable")
    size = np.bincount(part)
    rank = np.arange(total) - np.repeat(np.cumsum(size) - size, size)
    up_to = np.cumsum(np.bincount(rank))
    last = int(np.searchsorted(up_to, count))
    whole, partly = by_part[rank < last], np.sort(by_part[rank == last])
    return np.sort(np.concatenate([whole, partly[: count - len(whole)]]))

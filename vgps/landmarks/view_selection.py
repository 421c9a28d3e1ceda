"""Landmarks in a camera's image, the best view of each, and a subset spread over the image.

(B) of Matsuda 2007: project, Eq. (4), and keep what falls in the image.
"""

from dataclasses import dataclass
from functools import cache
from math import cos, radians, sqrt

import numpy as np

from vgps.config import SelectionConfig
from vgps.model import Camera, Float32Array, FloatArray, IntArray

_MIN_DEPTH_M = 0.1  # nearer landmarks project anywhere
_FAR_M = 1e30  # stands for no limit; within float32
_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


@dataclass(frozen=True)
class VisibleLandmarks:
    """Landmarks in the image.

    Attributes:
        row: (n,) rows of the points given.
        uv_px: (2, n) projections.
        pixel_m: (n,) metres that a pixel of the camera covers at the landmark.
    """

    row: IntArray
    uv_px: Float32Array
    pixel_m: Float32Array

    def take(self, rows: IntArray) -> "VisibleLandmarks":
        """Return the landmarks in ``rows``."""
        return VisibleLandmarks(self.row[rows], self.uv_px[:, rows], self.pixel_m[rows])


@dataclass(frozen=True)
class BestViews:
    """The best view of each landmark.

    Attributes:
        view: (n,) number of the view within its landmark, -1 where none suits.
        cost: (n,) squared distance to the camera in direction and scale; 0 for a view from the same place.
        sine: (n,) sine of the angle between the directions to the view's and to this camera.
    """

    view: IntArray
    cost: Float32Array
    sine: Float32Array

    def ranking_cost(
        self, pixel_m: Float32Array, sigma_px: FloatArray, position_sigma_m: FloatArray
    ) -> FloatArray:
        """Return a cost (n,) by which landmarks are ranked: the less, the better the expected match.

        A position is uncertain along the rays of its observations, which shows in the image in proportion to
        the sine of the angle by which the camera departs from them.
        """
        position_sigma_px = position_sigma_m * self.sine / pixel_m
        return np.asarray(np.hypot(sigma_px, position_sigma_px) * (1 + self.cost))


def focal_px(camera: Camera) -> float:
    """Return one focal length for both axes: the geometric mean."""
    return sqrt(camera.fx * camera.fy)


@cache
def corner_cosine(camera: Camera) -> float:
    """Return the cosine of the angle between the optical axis and the ray of the farthest image corner."""
    uv = _CORNERS * (camera.width, camera.height) - 0.5
    rays = (uv - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return float(1 / np.sqrt(1 + np.sum(rays**2, axis=1).max()))


@cache
def _frustum(camera: Camera, max_depth_m: float | None) -> FloatArray:
    """Return half-spaces (6, 4) of the camera frustum: a point (x, y, z, 1) inside gives no negative value.

    The rows measure: pixels from the left and from the upper border, times the depth; depth beyond the least;
    pixels from the right and from the lower border, times the depth; depth short of the largest.
    """
    right, low = camera.width - 0.5, camera.height - 0.5
    of_pixels = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1], [-1, 0, right], [0, -1, low], [0, 0, -1]])
    limits = np.array([0, 0, -_MIN_DEPTH_M, 0, 0, _FAR_M if max_depth_m is None else max_depth_m])
    return np.column_stack([of_pixels @ camera.K, limits])


def visible_landmarks(
    world_T_camera: FloatArray, camera: Camera, points: Float32Array, max_depth_m: float | None
) -> VisibleLandmarks:
    """Return the homogeneous points (4, N) that project into the camera's undistorted image."""
    # one row per axis rather than per point: numpy is several times faster along rows
    of_camera = _frustum(camera, max_depth_m)
    of_world = of_camera[:, :3] @ world_T_camera[:3, :3].T
    shift = of_camera[:, 3:] - of_world @ world_T_camera[:3, 3:]
    measures = np.hstack([of_world, shift]).astype(np.float32) @ points
    row = np.flatnonzero(measures.min(axis=0) >= 0)
    seen = measures[:3].take(row, axis=1)
    depth = seen[2] + np.float32(_MIN_DEPTH_M)
    return VisibleLandmarks(row, seen[:2] / depth - np.float32(0.5), depth / np.float32(focal_px(camera)))


def best_views(
    to_camera: Float32Array, pixel_m: Float32Array, view_geometry: Float32Array, config: SelectionConfig
) -> BestViews:
    """Return the view of each landmark that is closest to the camera in direction and scale.

    Args:
        to_camera: (3, n) from the landmark to the camera, metres.
        pixel_m: (n,) metres that a pixel of the camera covers at the landmark.
        view_geometry: (n, 7, V) direction, normal and log2 of the pixel size of each view; NaN where there is
            none.
        config: Limits on direction, tilt and scale.
    """
    if not len(view_geometry):
        return BestViews(np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros(0, np.float32))
    view_geometry = np.ascontiguousarray(view_geometry.transpose(1, 2, 0))  # long rows are faster, as above
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
    """Return rows of up to ``count`` points: the first of every image tile, then every tile's second, ...

    Args:
        uv_px: (2, N), best first.
        size_px: Width and height of the image, which is divided into about ``count`` square tiles.
        count: Number of rows; all if there are no more.

    Returns:
        Rows in ascending order.
    """
    total = uv_px.shape[1]
    if total <= count:
        return np.arange(total)
    side = sqrt(size_px[0] * size_px[1] / max(count, 1))
    # there are hardly more tiles than count; 16 bits are sorted in linear time
    column, line = ((uv_px + 0.5) / side).astype(np.uint16 if count < 2**14 else np.uint32)
    tile = line * (int(size_px[0] / side) + 1) + column
    by_tile = np.argsort(tile, kind="stable")
    size = np.bincount(tile)
    rank = np.arange(total) - np.repeat(np.cumsum(size) - size, size)
    up_to = np.cumsum(np.bincount(rank))
    last = int(np.searchsorted(up_to, count))
    complete, partial = by_tile[rank < last], np.sort(by_tile[rank == last])
    return np.sort(np.concatenate([complete, partial[: count - len(complete)]]))

"""Which landmarks a camera sees, which view of each suits it, and which to take where there are too many.

(B) of Matsuda 2007: project (4), keep what falls in the image.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from vgps.landmarks.build_settings import SelectionConfig
from vgps.model import BoolArray, Camera, FloatArray, IntArray

MIN_DEPTH_M = 0.1
_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


@dataclass(frozen=True)
class Candidates:
    """Landmarks in the image: ``row`` (n,) of the table asked, ``uv_px`` (n, 2), and ``pixel_m`` (n,) metres
    that a pixel of the camera covers there."""

    row: IntArray
    uv_px: FloatArray
    pixel_m: FloatArray

    def take(self, rows: IntArray) -> "Candidates":
        """Some of them."""
        return Candidates(self.row[rows], self.uv_px[rows], self.pixel_m[rows])


@dataclass(frozen=True)
class BestViews:
    """Of each candidate the view that suits best.

    Attributes:
        view: (n,) which one, -1 where none suits.
        cost: (n,) how far from the camera in direction and scale, 0 where it is just this camera's.
        sine: (n,) of the angle between the two directions.
    """

    view: IntArray
    cost: FloatArray
    sine: FloatArray

    def badness(self, pixel_m: FloatArray, sigma_px: FloatArray, position_sigma_m: FloatArray) -> FloatArray:
        """(n,) the less, the better a match to expect.

        A position is uncertain along the rays that gave it, which shows as far as the camera leaves them.
        """
        shown_px = position_sigma_m * self.sine / pixel_m
        return np.asarray(np.hypot(sigma_px, shown_px) * (1 + self.cost))


def focal_px(camera: Camera) -> float:
    """One focal length for both axes: the geometric mean."""
    return float(np.sqrt(camera.fx * camera.fy))


@cache
def corner_cosine(camera: Camera) -> float:
    """Cosine of the angle between the optical axis and the ray of the image's furthest corner."""
    uv = _CORNERS * (camera.width, camera.height) - 0.5
    rays = (uv - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return float(1 / np.sqrt(1 + np.sum(rays**2, axis=1).max()))


def in_image(
    world_T_camera: FloatArray, camera: Camera, points: FloatArray, max_depth_m: float | None
) -> Candidates:
    """Those of the points (3, N), a column each, that the undistorted image of the camera shows."""
    # a row for each axis, not for each point: numpy is several times faster along rows
    x, y, depth = world_T_camera[:3, :3].T @ (points - world_T_camera[:3, 3:])
    limit = np.inf if max_depth_m is None else max_depth_m
    row = np.flatnonzero((depth > MIN_DEPTH_M) & (depth <= limit))
    depth = depth[row]
    u = x[row] / depth * camera.fx + camera.cx
    v = y[row] / depth * camera.fy + camera.cy
    inside = (u >= -0.5) & (u < camera.width - 0.5) & (v >= -0.5) & (v < camera.height - 0.5)
    uv = np.column_stack([u[inside], v[inside]])
    return Candidates(row[inside], uv, depth[inside] / focal_px(camera))


def best_views(
    to_camera: FloatArray,
    pixel_m: FloatArray,
    looks: npt.NDArray[np.float32],
    there: BoolArray,
    config: SelectionConfig,
) -> BestViews:
    """The view of each landmark that is nearest to the camera in direction and in scale.

    Args:
        to_camera: (n, 3) from the landmark to the camera, metres.
        pixel_m: (n,) metres that a pixel of the camera covers there.
        looks: (n, V, 7) direction, normal and log2 of the pixel size of each view.
        there: (n, V) whether there is such a view.
        config: What still suits.
    """
    if not len(looks):
        return BestViews(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    distance = np.sqrt(np.einsum("ni,ni->n", to_camera, to_camera))[:, None]
    direction = (to_camera / distance).astype(np.float32)
    cosine = np.einsum("nvi,ni->nv", looks[..., :3], direction)
    facing = np.einsum("nvi,ni->nv", looks[..., 3:6], direction)
    octaves = np.log2(pixel_m).astype(np.float32)[:, None] - looks[..., 6]
    suits = there & (cosine >= np.cos(np.radians(config.max_view_angle_deg)))
    suits &= facing >= np.cos(np.radians(config.max_tilt_deg))
    suits &= (octaves >= -config.nearer_octaves) & (octaves <= config.further_octaves)
    angle2 = 2 * (1 - cosine) / np.radians(config.angle_unit_deg) ** 2
    cost = np.where(suits, angle2 + (octaves / config.octave_unit) ** 2, np.inf)
    view = cost.argmin(axis=1)
    row = np.arange(len(view))
    sine = np.sqrt(np.clip(1 - cosine[row, view] ** 2, 0, 1))
    return BestViews(np.where(suits[row, view], view, -1), cost[row, view], sine)


def spread(uv_px: FloatArray, camera: Camera, count: int) -> IntArray:
    """Rows of the ``count`` to take: the first in every part of the image, then every part's second, ...

    Args:
        uv_px: (N, 2), the best first.
        camera: For the size of its image, which is parted into about ``count`` squares.
        count: How many; all if there are no more.

    Returns:
        Rows in ascending order.
    """
    if len(uv_px) <= count:
        return np.arange(len(uv_px))
    side = np.sqrt(camera.width * camera.height / max(count, 1))
    column, line = ((uv_px.T + 0.5) / side).astype(np.int32)
    # there are hardly more squares than count; sixteen bits are sorted in linear time
    part = (line * (int(camera.width / side) + 1) + column).astype(np.uint16 if count < 2**14 else np.uint32)
    by_part = np.argsort(part, kind="stable")
    ordered = part[by_part]
    limits = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1], [True]]))
    row = np.arange(len(part))
    rank = np.empty(len(part), np.int64)
    rank[by_part] = row - np.repeat(limits[:-1], limits[1:] - limits[:-1])
    return np.sort(np.argpartition(rank * len(part) + row, count - 1)[:count])

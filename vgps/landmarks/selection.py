"""Which landmarks a camera sees, which view of each suits it, and which to take where there are too many.

(B) of Matsuda 2007: project (4), keep what falls in the image.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vgps.landmarks.build_settings import SelectionConfig
from vgps.model import Camera, FloatArray, IntArray

MIN_DEPTH_M = 0.1
_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


@dataclass(frozen=True)
class Candidates:
    """Landmarks in the image: ``row`` (n,) of the table asked, ``uv_px`` (n, 2), ``pixel_m`` (n,) metres that
    a pixel of the camera covers there, ``direction`` (n, 3) from the landmark to the camera."""

    row: IntArray
    uv_px: FloatArray
    pixel_m: FloatArray
    direction: FloatArray


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

    def badness(self, candidates: Candidates, numbers: FloatArray) -> FloatArray:
        """(n,) the less, the better a match to expect, from position, sigma_px and position_sigma_m (n, 5).

        A position is uncertain along the rays that gave it, which shows as far as the camera leaves them.
        """
        shown_px = numbers[:, 4] * self.sine / candidates.pixel_m
        return np.asarray(np.hypot(numbers[:, 3], shown_px) * (1 + self.cost))


def focal_px(camera: Camera) -> float:
    """One focal length for both axes: the geometric mean."""
    return float(np.sqrt(camera.fx * camera.fy))


def slabs(
    world_T_camera: FloatArray, camera: Camera, near_m: float, far_m: float
) -> tuple[FloatArray, FloatArray]:
    """The part of the world in view between two depths, in slices that double in depth.

    Returns:
        ``depth_m`` (S, 2) from and to, and ``box`` (S, 2, 3) least and greatest world coordinates of each.
    """
    near_m = max(near_m, MIN_DEPTH_M)
    if not far_m > near_m:
        return np.zeros((0, 2)), np.zeros((0, 2, 3))
    count = max(1, int(np.ceil(np.log2(far_m / near_m))))
    edges = np.geomspace(near_m, far_m, count + 1)
    uv = _CORNERS * (camera.width, camera.height) - 0.5
    rays = np.column_stack([(uv - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(4)])
    corners = edges[:, None, None] * (rays @ world_T_camera[:3, :3].T) + world_T_camera[:3, 3]
    both = np.concatenate([corners[:-1], corners[1:]], axis=1)
    return np.column_stack([edges[:-1], edges[1:]]), np.stack([both.min(axis=1), both.max(axis=1)], axis=1)


def in_image(
    world_T_camera: FloatArray, camera: Camera, points: FloatArray, max_depth_m: float | None
) -> Candidates:
    """Those of the points (N, 3) that the undistorted image of the camera shows."""
    to_point = points - world_T_camera[:3, 3]
    camera_p = to_point @ world_T_camera[:3, :3]
    depth = camera_p[:, 2]
    limit = np.inf if max_depth_m is None else max_depth_m
    row = np.flatnonzero((depth > MIN_DEPTH_M) & (depth <= limit))
    depth = depth[row]
    uv = camera_p[row, :2] / depth[:, None] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    inside = ((uv >= -0.5) & (uv < (camera.width - 0.5, camera.height - 0.5))).all(axis=1)
    row, uv, depth = row[inside], uv[inside], depth[inside]
    look = to_point[row]
    direction = -look / np.sqrt(np.einsum("ij,ij->i", look, look))[:, None]
    return Candidates(row, uv, depth / focal_px(camera), direction)


def best_views(candidates: Candidates, looks: npt.NDArray[np.float32], config: SelectionConfig) -> BestViews:
    """The view of each candidate that is nearest to the camera in direction and in scale.

    Args:
        candidates: n landmarks.
        looks: (n, V, 7) direction, normal and log2 of the pixel size of each view, NaN where there is none.
        config: What still suits.
    """
    if not len(looks):
        return BestViews(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    direction = candidates.direction.astype(np.float32)
    cosine = np.einsum("nvi,ni->nv", looks[..., :3], direction)
    facing = np.einsum("nvi,ni->nv", looks[..., 3:6], direction)
    octaves = np.log2(candidates.pixel_m).astype(np.float32)[:, None] - looks[..., 6]
    suits = cosine >= np.cos(np.radians(config.max_view_angle_deg))
    suits &= facing >= np.cos(np.radians(config.max_tilt_deg))
    suits &= (octaves >= -config.nearer_octaves) & (octaves <= config.further_octaves)
    angle2 = 2 * (1 - cosine) / np.radians(config.angle_unit_deg) ** 2
    cost = np.where(suits, angle2 + (octaves / config.octave_unit) ** 2, np.inf)
    view = cost.argmin(axis=1)
    row = np.arange(len(view))
    sine = np.sqrt(np.clip(1 - cosine[row, view] ** 2, 0, 1))
    return BestViews(np.where(suits[row, view], view, -1), cost[row, view], sine)


def spread(uv_px: FloatArray, badness: FloatArray, camera: Camera, count: int) -> IntArray:
    """Rows of the ``count`` to take: the best of every part of the image, then every part's second, ...

    Args:
        uv_px: (N, 2).
        badness: (N,) less is better.
        camera: For the size of its image, which is parted into about ``count`` squares.
        count: How many; all if there are no more.

    Returns:
        Rows in ascending order.
    """
    if len(uv_px) <= count:
        return np.arange(len(uv_px))
    side = np.sqrt(camera.width * camera.height / max(count, 1))
    column, line = np.floor((uv_px + 0.5) / side).astype(np.int64).T
    part = line * (int(camera.width / side) + 1) + column
    order = np.lexsort((badness, part))
    ordered = part[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=-1))
    rank = np.arange(len(order)) - np.repeat(begins, np.diff(np.append(begins, len(order))))
    taken = np.lexsort((badness[order], rank))[:count]
    return np.sort(order[taken])

"""Landmarks that may be of use to a camera from around a place, whichever way it looks."""

from dataclasses import dataclass

import numpy as np

from vgps.landmarks.build_settings import SelectionConfig
from vgps.landmarks.opening import DatabaseFile
from vgps.landmarks.pool import LandmarkPool
from vgps.landmarks.selection import corner_cosine, focal_px
from vgps.model import Camera, FloatArray, IntArray

_AROUND = """
SELECT id FROM cell_box
WHERE east_1 >= ? AND east_0 <= ? AND north_1 >= ? AND north_0 <= ? AND up_1 >= ? AND up_0 <= ?
AND pixel_1 >= ? AND pixel_0 <= ?
"""
_ROUNDING = 1e-3  # of the float32 numbers by which landmarks are passed over, in radians and octaves


@dataclass(frozen=True)
class Region:
    """Landmarks of use within ``radius_m`` of a place to a camera of such optics.

    Attributes:
        rows: (n,) of the pool, the most reliable landmark first.
        points: (3, n) a column each.
    """

    centre: FloatArray
    radius_m: float
    optics: tuple[float, float, float | None]
    rows: IntArray
    points: FloatArray

    def serves(self, place: FloatArray, optics: tuple[float, float, float | None]) -> bool:
        """Whether a camera there is within it."""
        away = place - self.centre
        return optics == self.optics and float(away @ away) <= self.radius_m**2


def optics(camera: Camera, max_depth_m: float | None) -> tuple[float, float, float | None]:
    """What of a camera decides which landmarks are of use: focal length, corner's cosine, largest depth."""
    return focal_px(camera), corner_cosine(camera), max_depth_m


def region_around(
    centre: FloatArray,
    seen_by: tuple[float, float, float | None],
    file: DatabaseFile,
    pool: LandmarkPool,
    config: SelectionConfig,
) -> Region:
    """All landmarks that have a view which may suit a camera of such optics near a place.

    Raises:
        LandmarkDatabaseError: The file is damaged.
    """
    rows = pool.rows(_cells_around(centre, seen_by, file, config))
    rows = rows[_may_suit(centre, pool.numbers[rows, :3], rows, seen_by, pool, config)]
    rows = rows[np.argsort(pool.numbers[rows, 3], kind="stable")]
    points = np.ascontiguousarray(pool.numbers[rows, :3].T)
    return Region(centre, config.region_m, seen_by, rows, points)


def _cells_around(
    centre: FloatArray,
    seen_by: tuple[float, float, float | None],
    file: DatabaseFile,
    config: SelectionConfig,
) -> list[int]:
    """Cells with landmarks that lie as far off as their views have it, by shells that double in distance."""
    focal, cosine, max_depth_m = seen_by
    smaller, larger = 2.0**-config.nearer_octaves, 2.0**config.further_octaves
    finest, coarsest = file.meta.pixel_m
    near_m, far_m = focal * finest * smaller, focal * coarsest * larger
    if max_depth_m is not None:
        far_m = min(far_m, max_depth_m)
    far_m = far_m / cosine + config.region_m
    found: set[int] = set()
    inner = 0.0
    outer = near_m + config.region_m
    while inner < far_m:
        sides = np.column_stack([centre - outer, centre + outer]).ravel().tolist()
        least = max(inner - config.region_m, 0.0) * cosine / focal / larger
        most = (outer + config.region_m) / focal / smaller
        found.update(key for (key,) in file.rows(_AROUND, (*sides, least, most)))
        inner, outer = outer, 2 * outer
    return sorted(found)


def _may_suit(
    centre: FloatArray,
    points: FloatArray,
    rows: IntArray,
    seen_by: tuple[float, float, float | None],
    pool: LandmarkPool,
    config: SelectionConfig,
) -> IntArray:
    """Of landmarks (n, 3) those that were seen about so large and from about there."""
    focal, cosine, _ = seen_by
    to_camera = centre - points
    distance = np.sqrt(np.einsum("ij,ij->i", to_camera, to_camera))
    nearest = np.maximum(distance - config.region_m, 1e-9)
    octaves = pool.octaves[rows]
    suits = np.log2((distance + config.region_m) / focal) >= octaves[:, 0] - config.nearer_octaves - _ROUNDING
    suits &= np.log2(nearest * cosine / focal) <= octaves[:, 1] + config.further_octaves + _ROUNDING
    turned = np.arcsin(np.minimum(config.region_m / np.maximum(distance, 1e-9), 1.0))
    limit = np.radians(config.max_view_angle_deg) + pool.slack_rad[rows] + turned + _ROUNDING
    along = np.einsum("ij,ij->i", to_camera, pool.mean_direction[rows])
    near = distance <= config.region_m
    suits &= near | (along >= distance * np.cos(np.minimum(limit, np.pi)))
    return np.flatnonzero(suits)

"""Landmarks that may be of use to a camera from around a place, whichever way it looks."""

from dataclasses import dataclass

import numpy as np

from vgps.config import SelectionConfig
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.landmark_table import LandmarkTable
from vgps.landmarks.view_selection import corner_cosine, focal_px
from vgps.model import BoolArray, Camera, Float32Array, FloatArray, IntArray

_AROUND = """
SELECT id FROM cell_box
WHERE east_1 >= ? AND east_0 <= ? AND north_1 >= ? AND north_0 <= ? AND up_1 >= ? AND up_0 <= ?
AND pixel_1 >= ? AND pixel_0 <= ?
"""
_ROUNDING = 1e-3  # of the float32 numbers by which landmarks are passed over, in radians and octaves


@dataclass(frozen=True)
class CandidateRegion:
    """Landmarks of use within ``radius_m`` of a place to a camera of such optics.

    Attributes:
        rows: (n,) of the pool, the best prospect first.
        points: (4, n) a column (x, y, z, 1) each, counted from the centre, about which float32 is precise.
    """

    centre: FloatArray
    radius_m: float
    optics: tuple[float, float, float | None]
    rows: IntArray
    points: Float32Array

    def serves(self, place: FloatArray, optics: tuple[float, float, float | None]) -> bool:
        """Whether a camera there is within it."""
        away = place - self.centre
        return optics == self.optics and float(away @ away) <= self.radius_m**2


def optics(camera: Camera, max_depth_m: float | None) -> tuple[float, float, float | None]:
    """What of a camera decides which landmarks are of use: focal length, corner's cosine, largest depth."""
    return focal_px(camera), corner_cosine(camera), max_depth_m


def find_candidates(
    centre: FloatArray,
    seen_by: tuple[float, float, float | None],
    file: DatabaseFile,
    pool: LandmarkTable,
    config: SelectionConfig,
) -> CandidateRegion:
    """All landmarks that have a view which may suit a camera of such optics near a place.

    Raises:
        LandmarkDatabaseError: The file is damaged.
    """
    rows = pool.rows(_cells_around(centre, seen_by, file, config))
    suits, cost = _prospects(centre, rows, seen_by, pool, config)
    rows, ranking_cost = rows[suits], (pool.numbers[rows, 3] * (1 + cost))[suits]
    rows = rows[np.argsort(ranking_cost, kind="stable")]
    points = np.ones((4, len(rows)), np.float32)
    points[:3] = (pool.numbers[rows, :3] - centre).T
    return CandidateRegion(centre, config.region_m, seen_by, rows, points)


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


def _prospects(
    centre: FloatArray,
    rows: IntArray,
    seen_by: tuple[float, float, float | None],
    pool: LandmarkTable,
    config: SelectionConfig,
) -> tuple[BoolArray, FloatArray]:
    """Of landmarks (n,) whether they were seen about so large and from about there, and what that costs.

    The cost is that of a view as near as the landmark's views reach, in direction and in scale.
    """
    focal, cosine, _ = seen_by
    to_camera = centre - pool.numbers[rows, :3]
    distance = np.maximum(np.sqrt(np.einsum("ij,ij->i", to_camera, to_camera)), 1e-9)
    least, most = pool.octaves[rows].T
    nearest = np.log2(np.maximum(distance - config.region_m, 1e-9) * cosine / focal)
    furthest = np.log2((distance + config.region_m) / focal)
    suits = (furthest >= least - config.nearer_octaves - _ROUNDING) & (
        nearest <= most + config.further_octaves + _ROUNDING
    )
    along = np.einsum("ij,ij->i", to_camera, pool.mean_direction[rows]) / distance
    angle = np.arccos(np.clip(along, -1.0, 1.0)) - pool.spread_rad[rows]
    turned = np.arcsin(np.minimum(config.region_m / distance, 1.0))
    limit = np.radians(config.max_view_angle_deg) + turned + _ROUNDING
    suits &= (angle <= limit) | (distance <= config.region_m)

    here = np.log2(distance / focal)
    octaves = np.maximum(0.0, np.maximum(least - here, here - most))
    cost = (np.maximum(angle, 0.0) / np.radians(config.angle_unit_deg)) ** 2
    return suits, cost + (octaves / config.octave_unit) ** 2

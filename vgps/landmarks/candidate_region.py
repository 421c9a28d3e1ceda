"""Landmarks that a camera near a place may use, whatever its orientation."""

from dataclasses import dataclass

import numpy as np

from vgps.config import SelectionConfig
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.landmark_table import LandmarkTable
from vgps.landmarks.view_selection import corner_cosine, focal_px
from vgps.model import BoolArray, Camera, Float32Array, FloatArray, IntArray

_CELLS_IN_BOX = """
SELECT id FROM cell_box
WHERE east_1 >= ? AND east_0 <= ? AND north_1 >= ? AND north_0 <= ? AND up_1 >= ? AND up_0 <= ?
AND pixel_1 >= ? AND pixel_0 <= ?
"""
_ROUNDING = 1e-3  # slack for float32, in radians and octaves


@dataclass(frozen=True)
class Optics:
    """What of a camera decides which landmarks it can use.

    Attributes:
        focal_px: One focal length for both axes.
        corner_cosine: Cosine of the largest angle between the optical axis and a ray of the image.
        max_depth_m: Landmarks further in front of the camera are not used.
    """

    focal_px: float
    corner_cosine: float
    max_depth_m: float | None

    @classmethod
    def of(cls, camera: Camera, max_depth_m: float | None) -> "Optics":
        """Return the optics of a camera."""
        return cls(focal_px(camera), corner_cosine(camera), max_depth_m)


@dataclass(frozen=True, kw_only=True)
class CandidateRegion:
    """Landmarks that a camera within ``radius_m`` of ``centre`` may use.

    Attributes:
        centre: (3,) metres.
        radius_m: How far from the centre the camera may be.
        optics: Of the camera.
        rows: (n,) rows of the :class:`LandmarkTable`, most promising first.
        points: (4, n) homogeneous positions relative to the centre, where float32 is precise.
    """

    centre: FloatArray
    radius_m: float
    optics: Optics
    rows: IntArray
    points: Float32Array

    def serves(self, position: FloatArray, optics: Optics) -> bool:
        """Return whether the region holds all candidates of a camera at a position (3,)."""
        away = position - self.centre
        return optics == self.optics and float(away @ away) <= self.radius_m**2


def find_candidates(
    centre: FloatArray, optics: Optics, file: DatabaseFile, table: LandmarkTable, config: SelectionConfig
) -> CandidateRegion:
    """Find all landmarks with a view that may suit a camera near a place.

    Raises:
        LandmarkDatabaseError: The file is damaged.
    """
    rows = table.rows(_cells_around(centre, optics, file, config))
    suits, cost = _suitability(centre, rows, optics, table, config)
    rows, ranking = rows[suits], (table.numbers[rows, 3] * (1 + cost))[suits]
    rows = rows[np.argsort(ranking, kind="stable")]
    points = np.ones((4, len(rows)), np.float32)
    points[:3] = (table.numbers[rows, :3] - centre).T
    return CandidateRegion(centre=centre, radius_m=config.region_m, optics=optics, rows=rows, points=points)


def _cells_around(
    centre: FloatArray, optics: Optics, file: DatabaseFile, config: SelectionConfig
) -> list[int]:
    """Return ids of cells whose distance fits the scale of their views, in shells that double in radius."""
    focal, cosine = optics.focal_px, optics.corner_cosine
    smaller, larger = 2.0**-config.nearer_octaves, 2.0**config.further_octaves
    finest, coarsest = file.meta.pixel_m
    near_m, far_m = focal * finest * smaller, focal * coarsest * larger
    if optics.max_depth_m is not None:
        far_m = min(far_m, optics.max_depth_m)
    far_m = far_m / cosine + config.region_m
    cells: set[int] = set()
    inner = 0.0
    outer = near_m + config.region_m
    while inner < far_m:
        sides = np.column_stack([centre - outer, centre + outer]).ravel().tolist()
        least = max(inner - config.region_m, 0.0) * cosine / focal / larger
        most = (outer + config.region_m) / focal / smaller
        cells.update(cell for (cell,) in file.rows(_CELLS_IN_BOX, (*sides, least, most)))
        inner, outer = outer, 2 * outer
    return sorted(cells)


def _suitability(
    centre: FloatArray, rows: IntArray, optics: Optics, table: LandmarkTable, config: SelectionConfig
) -> tuple[BoolArray, FloatArray]:
    """Return which landmarks (n,) may have a suitable view, and a lower bound of its cost.

    The bound is the cost of a view as close to the camera as the ranges of the landmark's views allow.
    """
    focal, cosine = optics.focal_px, optics.corner_cosine
    to_camera = centre - table.numbers[rows, :3]
    distance = np.maximum(np.sqrt(np.einsum("ij,ij->i", to_camera, to_camera)), 1e-9)
    least, most = table.octaves[rows].T
    nearest = np.log2(np.maximum(distance - config.region_m, 1e-9) * cosine / focal)
    furthest = np.log2((distance + config.region_m) / focal)
    suits = (furthest >= least - config.nearer_octaves - _ROUNDING) & (
        nearest <= most + config.further_octaves + _ROUNDING
    )
    along = np.einsum("ij,ij->i", to_camera, table.mean_direction[rows]) / distance
    angle = np.arccos(np.clip(along, -1.0, 1.0)) - table.spread_rad[rows]
    parallax = np.arcsin(np.minimum(config.region_m / distance, 1.0))
    limit = np.radians(config.max_view_angle_deg) + parallax + _ROUNDING
    suits &= (angle <= limit) | (distance <= config.region_m)

    here = np.log2(distance / focal)
    octaves = np.maximum(0.0, np.maximum(least - here, here - most))
    cost = (np.maximum(angle, 0.0) / np.radians(config.angle_unit_deg)) ** 2
    return suits, cost + (octaves / config.octave_unit) ** 2

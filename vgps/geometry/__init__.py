"""Vectorised geometry: projection, triangulation, interpolation, angular rates."""

from vgps.geometry.cross_product import cross_matrices
from vgps.geometry.interpolation import interpolate_poses, interpolate_vectors
from vgps.geometry.paths import travelled
from vgps.geometry.projection import (
    MIN_DEPTH,
    in_picture,
    largest_angle_rad,
    linearise_projection,
    project,
    rays,
    reprojection_inliers,
    triangulate,
    world_rays,
    world_sigmas,
)
from vgps.geometry.rotation_vectors import rotation_matrices, rotation_vectors

__all__ = [
    "MIN_DEPTH",
    "cross_matrices",
    "in_picture",
    "interpolate_poses",
    "interpolate_vectors",
    "largest_angle_rad",
    "linearise_projection",
    "project",
    "rays",
    "reprojection_inliers",
    "rotation_matrices",
    "rotation_vectors",
    "travelled",
    "triangulate",
    "world_rays",
    "world_sigmas",
]

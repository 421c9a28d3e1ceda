"""Parallelograms of a world as a camera sees them."""

from dataclasses import dataclass

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.simulate.canvas import Canvas
from vgps.simulate.polygons import NEAR_M, Plane, Polygon, clipped
from vgps.simulate.world import World

_BESIDE_M = 1e-6  # from the plane of a parallelogram


@dataclass(frozen=True)
class Faces:
    """Parallelograms that may be in view from a pose.

    Attributes:
        row: (n,) rows of the world.
        corners: (n, 4, 3) in the camera frame.
        whole: (n,) whether they are in view as a whole.
        planes: Inward normals of the view's sides.
    """

    row: IntArray
    corners: FloatArray
    whole: BoolArray
    planes: tuple[Plane, ...]

    @property
    def distance(self) -> FloatArray:
        """(n,) distances of their middles."""
        return np.asarray(np.linalg.norm(self.corners.mean(axis=1), axis=-1))

    def polygon(self, k: int) -> Polygon:
        """Return the part of one of them that is in view."""
        polygon: Polygon = [tuple(corner) for corner in self.corners[k].tolist()]
        return polygon if self.whole[k] else clipped(polygon, self.planes)


def faces_in_view(world: World, canvas: Canvas, world_T_camera: FloatArray, t_s: float) -> Faces:
    """Return the parallelograms that may be in view at a time."""
    normals = canvas.sides()
    origin, u, v = _in_camera(world, slice(None), world_T_camera, t_s)
    corners = np.stack([origin, origin + u, origin + u + v, origin + v], axis=1)
    facing = np.einsum("qi,qi->q", origin, np.cross(u, v))
    within = corners @ normals.T > np.array([0, 0, 0, 0, NEAR_M])
    inside, whole = np.all(np.any(within, axis=1), axis=1), np.all(within, axis=(1, 2))
    drawn = np.flatnonzero(inside & ((facing > 1e-9) | (world.two_sided & (np.abs(facing) > 1e-9))))
    planes = tuple((float(a), float(b), float(c)) for a, b, c in normals)
    return Faces(drawn, corners[drawn], whole[drawn], planes)


def texture_maps(
    world: World, rows: IntArray, K: FloatArray, world_T_camera: FloatArray, t_s: float
) -> FloatArray:
    """Return maps (n, 3, 3) of parallelograms from pixels (u, v, 1) to texture (a, b, 1) / depth."""
    origin, u, v = _in_camera(world, rows, world_T_camera, t_s)
    normal = np.cross(u, v)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    # seen from its own plane a parallelogram has no map; from just beside that it is the same line
    within = np.abs(np.einsum("ni,ni->n", origin, normal)) < _BESIDE_M
    origin += _BESIDE_M * within[:, None] * normal
    texture_h_px: FloatArray = np.linalg.inv(K @ np.stack([u, v, origin], axis=-1)).astype(np.float64)
    repeat = world.repeat[rows, None]
    texture_h_px[:, 0] *= repeat
    texture_h_px[:, 1] *= repeat
    return texture_h_px


def _in_camera(
    world: World, rows: IntArray | slice, world_T_camera: FloatArray, t_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return origins and edges (n, 3) of parallelograms in the camera frame at a time."""
    R, centre = world_T_camera[:3, :3], world_T_camera[:3, 3]
    return (
        (world.origins(t_s)[rows] - centre) @ R,
        world.edge_u[rows] @ R,
        world.edge_v[rows] @ R,
    )

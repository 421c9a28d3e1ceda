"""Poses between the world frame of a run and a projected coordinate system."""

import numpy as np

from vgps.crs.system import CoordinateSystem
from vgps.errors import CoordinateSystemError
from vgps.geodesy import enu_R_ecef, to_enu, to_geodetic
from vgps.model import FloatArray, GeodeticPoint

_STEP_M = 10.0  # of the numerical axes: large against rounding, small against the Earth


def world_to_system(system: CoordinateSystem, origin: GeodeticPoint, world_p_point: FloatArray) -> FloatArray:
    """Return coordinates (N, 3) in the system of points (N, 3) in ENU at the origin."""
    return system.from_geodetic(to_geodetic(origin, world_p_point))


def poses_in_system(system: CoordinateSystem, origin: GeodeticPoint, poses: FloatArray) -> FloatArray:
    """Return poses (N, 4, 4) in easting, northing, height of poses in ENU at the origin.

    The rotation is about the system's own axes: grid north differs from north by the convergence.

    Raises:
        CoordinateSystemError: The system's coordinates are degrees.
    """
    moved = poses.copy()
    moved[:, :3, 3] = world_to_system(system, origin, poses[:, :3, 3])
    world_R_system = _axes(system, origin, moved[:, :3, 3])
    moved[:, :3, :3] = np.swapaxes(world_R_system, 1, 2) @ poses[:, :3, :3]
    return moved


def poses_in_world(system: CoordinateSystem, origin: GeodeticPoint, poses: FloatArray) -> FloatArray:
    """Return poses (N, 4, 4) in ENU at the origin of poses in the system: inverse of `poses_in_system`.

    Raises:
        CoordinateSystemError: The system's coordinates are degrees.
    """
    moved = poses.copy()
    moved[:, :3, 3] = to_enu(origin, *system.to_geodetic(poses[:, :3, 3]).T)
    moved[:, :3, :3] = _axes(system, origin, poses[:, :3, 3]) @ poses[:, :3, :3]
    return moved


def local_R_world(origin: GeodeticPoint, geodetic: FloatArray) -> FloatArray:
    """Return rotations (N, 3, 3) from ENU at the origin to ENU at latitudes and longitudes (N, 2+)."""
    here = enu_R_ecef(geodetic[:, 0], geodetic[:, 1])
    return np.asarray(here @ enu_R_ecef(*origin[:2]).T)


def _axes(system: CoordinateSystem, origin: GeodeticPoint, coordinates: FloatArray) -> FloatArray:
    """Return world_R_system (N, 3, 3) at coordinates (N, 3): the nearest rotation to the Jacobian."""
    if system.is_geographic:
        raise CoordinateSystemError(
            f"poses in {system.name}, whose axes are degrees", remedy="name a projected system, as UTM"
        )
    columns = []
    for axis in np.eye(3):
        ahead, behind = (
            to_enu(origin, *system.to_geodetic(coordinates + step * axis).T) for step in (_STEP_M, -_STEP_M)
        )
        columns.append((ahead - behind) / (2.0 * _STEP_M))
    u, _, vt = np.linalg.svd(np.stack(columns, axis=-1))
    return np.asarray(u @ vt)

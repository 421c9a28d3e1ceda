"""Geodetic positions to and from local East-North-Up; the only importer of pymap3d.

Eq. (7)-(10), Kume 2010, with the erratum: the rotation is that of the *origin*, not of each fix, so the
mapping from ECEF is linear and orthogonal. WGS84, degrees, ellipsoidal heights, metres.
"""

import numpy as np
import numpy.typing as npt
import pymap3d

from vgps.model import FloatArray, GeodeticPoint

# Somigliana's formula on WGS84
_EQUATOR_M_S2, _POLE_SHARE, _ECCENTRICITY2 = 9.7803253359, 0.00193185265241, 0.00669437999013
_FREE_AIR_1_S2 = 3.086e-6


def to_enu(
    origin: GeodeticPoint, latitude_deg: npt.ArrayLike, longitude_deg: npt.ArrayLike, height_m: npt.ArrayLike
) -> FloatArray:
    """Return east, north, up [m] of geodetic positions; Eq. (7)-(10), Kume 2010, rotated at the origin.

    Args:
        origin: Origin of the ENU frame.
        latitude_deg, longitude_deg, height_m: (N,) or scalars, WGS84, ellipsoidal height.

    Returns:
        (N, 3), or (3,) for scalars; NaN where an input is NaN.
    """
    enu = pymap3d.geodetic2enu(
        np.asarray(latitude_deg, float),
        np.asarray(longitude_deg, float),
        np.asarray(height_m, float),
        *origin,
    )
    return _stack(enu)


def to_geodetic(origin: GeodeticPoint, world_p_point: npt.ArrayLike) -> FloatArray:
    """Return latitude, longitude [deg] and ellipsoidal height [m] of ENU points: the inverse of `to_enu`.

    Args:
        origin: Origin of the ENU frame.
        world_p_point: (N, 3) or (3,), metres.

    Returns:
        Same shape: latitude, longitude in [-180, 180], height.
    """
    enu = np.asarray(world_p_point, float)
    return _stack(pymap3d.enu2geodetic(enu[..., 0], enu[..., 1], enu[..., 2], *origin))


def ecef_to_geodetic(ecef_m: npt.ArrayLike) -> FloatArray:
    """Return latitude, longitude [deg] and ellipsoidal height [m] of ECEF points [m], (N, 3) or (3,)."""
    xyz = np.asarray(ecef_m, float)
    return _stack(pymap3d.ecef2geodetic(xyz[..., 0], xyz[..., 1], xyz[..., 2]))


def enu_R_ecef(latitude_deg: npt.ArrayLike, longitude_deg: npt.ArrayLike) -> FloatArray:
    """Return the rotation (N, 3, 3) or (3, 3) from ECEF axes to east, north, up at a position."""
    latitude, longitude = np.asarray(latitude_deg, float), np.asarray(longitude_deg, float)
    columns = [_stack(pymap3d.ecef2enuv(*axis, latitude, longitude)) for axis in np.eye(3)]
    return np.stack(columns, axis=-1)


def enu_T_enu(new: GeodeticPoint, old: GeodeticPoint) -> FloatArray:
    """Return the transform (4, 4) from the ENU frame of one origin to that of another, by way of ECEF."""
    transform = np.eye(4)
    if new != old:
        transform[:3, :3] = enu_R_ecef(*new[:2]) @ enu_R_ecef(*old[:2]).T
        transform[:3, 3] = to_enu(new, *old)
    return transform


def heading_deg(world_R_camera: npt.ArrayLike) -> FloatArray:
    """Return the direction of the camera's forward (z) axis, degrees clockwise from north in [0, 360).

    Args:
        world_R_camera: (..., 3, 3) rotation, or (..., 4, 4) pose.

    Returns:
        (...,); NaN where the camera looks straight up or down.
    """
    forward = np.asarray(world_R_camera, float)[..., :3, 2]
    east, north = forward[..., 0], forward[..., 1]
    heading = np.degrees(np.arctan2(east, north)) % 360.0
    # a tiny negative angle rounds up to 360
    heading = np.where(heading >= 360.0, 0.0, heading)
    return np.where(np.hypot(east, north) < 1e-9, np.nan, heading)


def _stack(parts: tuple[npt.ArrayLike, ...]) -> FloatArray:
    return np.stack(np.broadcast_arrays(*parts), axis=-1).astype(np.float64)


def normal_gravity(place: GeodeticPoint) -> float:
    """Return gravity [m/s^2] at a place: Somigliana's formula (WGS84) with the free-air gradient."""
    sine2 = np.sin(np.radians(place.latitude_deg)) ** 2
    ground = _EQUATOR_M_S2 * (1.0 + _POLE_SHARE * sine2) / np.sqrt(1.0 - _ECCENTRICITY2 * sine2)
    return float(ground - _FREE_AIR_1_S2 * place.height_m)

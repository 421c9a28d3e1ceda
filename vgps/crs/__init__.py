"""Coordinate systems and geoids: from WGS 84 positions to the coordinates and heights of a country."""

from vgps.crs.geoid import Geoid, egm96, named_geoid
from vgps.crs.lookup import coordinate_system, decimal_year
from vgps.crs.system import ELLIPSOIDAL, CoordinateSystem

__all__ = [
    "ELLIPSOIDAL",
    "CoordinateSystem",
    "Geoid",
    "coordinate_system",
    "decimal_year",
    "egm96",
    "named_geoid",
]

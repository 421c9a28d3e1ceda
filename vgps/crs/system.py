"""A coordinate system: its name, what its heights are above, and the conversion to and from it."""

import re
from dataclasses import dataclass

import numpy as np
from pyproj import CRS, Transformer
from pyproj.enums import TransformDirection

from vgps.crs.geoid import Geoid
from vgps.errors import CoordinateSystemError
from vgps.model import FloatArray

ELLIPSOIDAL = "height above the WGS 84 ellipsoid"


@dataclass(frozen=True, kw_only=True)
class CoordinateSystem:
    """A coordinate system that positions of a run are converted to.

    Attributes:
        name: Its name and code.
        height_datum: What its heights are above.
        axes: Names of its three coordinates with units, east or longitude first.
        definition: It with its heights, for libraries that take pyproj's objects.
        epsg: Code of the horizontal part, if it has one.
        notes: What a user should know: accuracy of the conversion, frames taken as one.
        transformer: From longitude, latitude, ellipsoidal height; None for these themselves.
        has_heights: Whether the transformer gives the heights.
        geoid: What heights are above, unless the transformer gives them; None for the ellipsoid.
        epoch: Decimal year of the positions, for frames that move; infinite if there is none, as in PROJ.
    """

    name: str
    height_datum: str
    axes: tuple[str, str, str]
    definition: CRS
    epsg: int | None = None
    notes: tuple[str, ...] = ()
    transformer: Transformer | None = None
    has_heights: bool = False
    geoid: Geoid | None = None
    epoch: float = np.inf

    @property
    def horizontal_wkt1(self) -> str:
        """The definition without heights as WKT 1, which older formats have."""
        if self.epsg is not None:
            return str(CRS.from_epsg(self.epsg).to_wkt("WKT1_GDAL"))
        whole = self.definition
        flat = whole.sub_crs_list[0] if whole.is_compound else whole.to_2d()
        return str(flat.to_wkt("WKT1_GDAL"))

    @property
    def is_geographic(self) -> bool:
        """Whether the coordinates are longitude and latitude."""
        return self.axes[0] == "longitude_deg"

    @property
    def description(self) -> str:
        """Name and datum of the heights, for headers and reports."""
        return f"{self.name}, {self.height_datum}"

    @property
    def height_column(self) -> str:
        """A name of a column of heights that says what they are above: ``height_egm96_m``."""
        words = self.height_datum.removeprefix("height above ").removesuffix(" height")
        datum = "ellipsoidal" if self.height_datum == ELLIPSOIDAL else words.removeprefix("the geoid ")
        unit = self.axes[2].removeprefix("height_")
        return f"height_{re.sub('[^a-z0-9.]+', '_', datum.lower())}_{unit}"

    def from_geodetic(self, geodetic: FloatArray) -> FloatArray:
        """Return coordinates (N, 3), east or longitude first, of latitudes, longitudes and heights (N, 3).

        Raises:
            CoordinateSystemError: A position cannot be converted.
        """
        latitude, longitude, height = np.asarray(geodetic, float).reshape(-1, 3).T
        x, y, z = self._transformed(longitude, latitude, height, TransformDirection.FORWARD)
        if not self.has_heights:
            z = height if self.geoid is None else height - self.geoid.height_m(latitude, longitude)
        return np.column_stack([x, y, z])

    def to_geodetic(self, coordinates: FloatArray) -> FloatArray:
        """Return latitude, longitude [deg] and ellipsoidal height [m] (N, 3): inverse of `from_geodetic`.

        Raises:
            CoordinateSystemError: A position cannot be converted.
        """
        x, y, z = np.asarray(coordinates, float).reshape(-1, 3).T
        longitude, latitude, height = self._transformed(x, y, z, TransformDirection.INVERSE)
        if not self.has_heights:
            # a shift of datum in the plane ignores heights, so that its inverse misses by half a millimetre
            again = self._transformed(longitude, latitude, z, TransformDirection.FORWARD)
            nearer = 2.0 * x - again[0], 2.0 * y - again[1]
            longitude, latitude, _ = self._transformed(*nearer, z, TransformDirection.INVERSE)
            height = z if self.geoid is None else z + self.geoid.height_m(latitude, longitude)
        return np.column_stack([latitude, longitude, height])

    def _transformed(
        self, x: FloatArray, y: FloatArray, z: FloatArray, direction: TransformDirection
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        if self.transformer is None:
            return x, y, z
        year = np.full(len(x), self.epoch)
        found = np.stack(self.transformer.transform(x, y, z, year, direction=direction)[:3])
        known = np.isfinite(x) & np.isfinite(y) & (np.isfinite(z) | (not self.has_heights))
        if np.isinf(found[:, known]).any():
            raise CoordinateSystemError(
                f"a position cannot be converted to {self.name}", remedy="name a system of the run's place"
            )
        found[:, ~known] = np.nan
        return found[0], found[1], found[2]

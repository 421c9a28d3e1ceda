"""Geoids: the height of the level of the sea above the ellipsoid of WGS 84.

EGM96 comes with vgps as a grid of 15 minutes of arc (NGA and NASA, public domain). Its cubic interpolation is
within 1 cm of the values that NGA publishes for tests, and EGM96 itself is within about a metre of the geoid.
"""

import os
import re
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pyproj import Transformer
from pyproj.datadir import get_data_dir, get_user_data_dir  # type: ignore[attr-defined]
from pyproj.exceptions import ProjError

from vgps.errors import CoordinateSystemError
from vgps.model import FloatArray

Heights = Callable[[FloatArray, FloatArray], FloatArray]
_MARGIN = 12  # cells around the points that a cubic spline is fitted to
# grids of PROJ by the name that people use; `projsync` or a package proj-data installs them
_PROJ_GRIDS = {
    "egm2008": ("us_nga_egm08_25.tif", "egm08_25.gtx"),
    "egm08": ("us_nga_egm08_25.tif", "egm08_25.gtx"),
    "gcg2016": ("de_bkg_gcg2016.tif",),
    "geoid18": ("us_noaa_g2018u0.tif",),
    "gsigeo2011": ("jp_gsi_gsigeo2011.tif",),
    "osgm15": ("uk_os_OSGM15_GB.tif",),
    "raf20": ("fr_ign_RAF20.tif",),
}
_GTX = struct.Struct(">4d2i")  # south, west, steps; rows, columns
_PGM = re.compile(rb"P5\s(.*?)(\d{1,6})\s+(\d{1,6})\s+65535\s", re.DOTALL)
_PGM_NUMBERS = re.compile(rb"#\s*(Offset|Scale)\s+([-+]?\d+(?:\.\d+)?)\s")


@dataclass(frozen=True)
class Geoid:
    """A geoid model by name, and the function that returns its height [m] at latitudes and longitudes."""

    name: str
    heights: Heights

    def height_m(self, latitude_deg: npt.ArrayLike, longitude_deg: npt.ArrayLike) -> FloatArray:
        """Return the height [m] of the geoid above the ellipsoid, of the shape of the positions [deg].

        Raises:
            CoordinateSystemError: A position is outside the grid; NaN gives NaN.
        """
        latitude, longitude = np.broadcast_arrays(
            np.asarray(latitude_deg, float), np.asarray(longitude_deg, float)
        )
        known = np.isfinite(latitude) & np.isfinite(longitude)
        height = np.full(latitude.shape, np.nan)
        if known.any():
            height[known] = self.heights(latitude[known], longitude[known])
        outside = known & ~np.isfinite(height)
        if outside.any():
            place = f"{latitude[outside][0]:.4f}°, {longitude[outside][0]:.4f}°"
            raise CoordinateSystemError(
                f"the geoid {self.name} has no height at {place}", remedy="give a geoid of that place"
            )
        return height


@cache
def egm96() -> Geoid:
    """Return EGM96, which comes with vgps."""
    with as_file(files("vgps.crs") / "egm96_15.npz") as file, np.load(file) as stored:
        grid = stored["differences"].astype(np.int32).cumsum(axis=0).cumsum(axis=1) / 100.0
        corner, step = stored["corner"], float(stored["step"])
    return Geoid("EGM96", _of_grid(grid, (float(corner[0]), float(corner[1])), (step, step)))


def named_geoid(text: str) -> Geoid:
    """Return a geoid: ``egm96``, the name of another model whose grid PROJ finds, a file, or metres.

    Args:
        text: A name, a file (GTX or GeoTIFF as PROJ reads them, PGM as GeographicLib), or a number: a geoid
            everywhere that high above the ellipsoid.

    Raises:
        CoordinateSystemError: There is no such model or file, or it is not a grid.
    """
    try:
        constant = float(text)
    except ValueError:
        return _file(Path(text)) if Path(text).is_file() else _by_name(text)
    if not np.isfinite(constant):
        raise CoordinateSystemError(f"a geoid height of {text}", expected="a finite number of metres")
    return Geoid(
        f"a geoid {constant:g} m above the ellipsoid", lambda latitude, _: np.full_like(latitude, constant)
    )


def _by_name(text: str) -> Geoid:
    name = re.sub(r"[\s_-]", "", text.lower())
    if name == "egm96":
        return egm96()
    installed = os.pathsep.join([get_data_dir(), get_user_data_dir(), "/usr/share/proj"])
    folders = [Path(folder) for folder in installed.split(os.pathsep)]
    for grid in (*_PROJ_GRIDS.get(name, ()), text):
        found = next((folder / grid for folder in folders if (folder / grid).is_file()), None)
        if found is not None:
            return _of_proj(found, text if name in _PROJ_GRIDS else found.stem)
    raise CoordinateSystemError(
        f"no grid of the geoid {text}",
        expected=f"egm96, a grid file (.gtx, .tif, .pgm), metres, or {_PROJ_GRIDS.get(name, (text,))[0]} "
        f"in {folders[0]}",
        remedy="download the grid (cdn.proj.org, or projsync --file) and give its path with --geoid",
    )


def _file(path: Path) -> Geoid:
    if path.suffix.lower() == ".pgm":
        return _of_pgm(path)
    return _of_proj(path, path.stem)


def _of_proj(path: Path, name: str) -> Geoid:
    """Return a grid that PROJ reads; its heights are interpolated linearly, as PROJ does."""
    if path.suffix.lower() == ".gtx":
        _check_gtx(path)
    # PROJ's strings cannot quote a path with blanks or commas: a link of a plain name points to it
    with tempfile.TemporaryDirectory(prefix="vgps-") as folder:
        link = Path(folder) / f"grid{path.suffix.lower()}"
        link.symlink_to(path.resolve())
        pipeline = (
            "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
            f"+step +proj=vgridshift +grids={link} +multiplier=1"
        )
        try:
            transformer = Transformer.from_pipeline(pipeline)
            transformer.transform(0.0, 0.0, 0.0)  # PROJ opens the file at the first use
        except ProjError as error:
            raise CoordinateSystemError(
                "not a grid of heights that PROJ reads", file=path, expected="GTX, GeoTIFF or PGM"
            ) from error

    def heights(latitude: FloatArray, longitude: FloatArray) -> FloatArray:
        shifted = np.asarray(transformer.transform(longitude, latitude, np.zeros_like(latitude))[2])
        return np.where(np.isfinite(shifted), shifted, np.nan)

    return Geoid(name, heights)


def _check_gtx(path: Path) -> None:
    """Refuse a grid whose header promises more than the file has; PROJ would reserve memory for it."""
    with path.open("rb") as stream:
        head = stream.read(_GTX.size)
    rows, columns = _GTX.unpack(head)[4:] if len(head) == _GTX.size else (0, 0)
    if min(rows, columns) < 2 or path.stat().st_size < _GTX.size + 4 * rows * columns:
        raise CoordinateSystemError(
            "not a grid of heights",
            file=path,
            expected=f"GTX, of which {rows} x {columns} heights have {4 * rows * columns} bytes",
            remedy="download it again",
        )


def _of_pgm(path: Path) -> Geoid:
    """Return a grid in GeographicLib's format: 16-bit PGM from the north, offset and scale in comments."""
    data = path.read_bytes()
    header = _PGM.match(data)
    numbers = dict(_PGM_NUMBERS.findall(header[1])) if header else {}
    columns, rows = (int(header[2]), int(header[3])) if header else (0, 0)
    begin = header.end() if header else 0
    if len(numbers) < 2 or rows < 2 or not 0 < 2 * columns * rows <= len(data) - begin:
        raise CoordinateSystemError(
            "not a geoid grid in PGM", file=path, expected="P5 with 16 bits and comments Offset and Scale"
        )
    raw = np.frombuffer(data, ">u2", columns * rows, begin).reshape(rows, columns)[::-1]
    grid = float(numbers[b"Offset"]) + float(numbers[b"Scale"]) * raw.astype(np.float64)
    return Geoid(path.stem, _of_grid(grid, (-90.0, 0.0), (180.0 / (rows - 1), 360.0 / columns)))


def _of_grid(grid: FloatArray, corner_deg: tuple[float, float], step_deg: tuple[float, float]) -> Heights:
    """Return the cubic interpolation of a grid (R, C) around the whole Earth, rows from the south."""

    def heights(latitude: FloatArray, longitude: FloatArray) -> FloatArray:
        from scipy.ndimage import map_coordinates  # noqa: PLC0415  (slow to import)

        row = (latitude - corner_deg[0]) / step_deg[0]
        column = (longitude - corner_deg[1]) / step_deg[1]
        # across the seam, the cells around the first point are the near ones
        column = column[0] + (column - column[0] + len(grid[0]) / 2) % len(grid[0]) - len(grid[0]) / 2
        low = np.floor([row.min(), column.min()]).astype(int) - _MARGIN
        high = np.ceil([row.max(), column.max()]).astype(int) + _MARGIN
        rows = np.arange(max(low[0], 0), min(high[0], len(grid) - 1) + 1)
        cells = grid[np.ix_(rows, np.arange(low[1], high[1] + 1) % len(grid[0]))]
        return np.asarray(map_coordinates(cells, [row - rows[0], column - low[1]], order=3, mode="mirror"))

    return heights

"""Control and check points: ``control_points.csv``, and ODM's ``gcp_list.txt``.

``control_points.csv`` has a row per observation: ``frame, u_px, v_px`` and a position in one of three ways:
``east_m, north_m, up_m`` (ENU at the world origin), ``latitude_deg, longitude_deg, height_m`` (above the
ellipsoid, or above the geoid given), or ``x, y, height_m`` in a coordinate system given. Optional: ``name``
of the mark (without it, its position identifies it), ``role`` (``control`` or ``check``), ``sigma_east_m``,
``sigma_north_m``, ``sigma_up_m``.
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgps.crs import coordinate_system
from vgps.crs.lookup import place_in
from vgps.errors import RecordingError
from vgps.model import BoolArray, ControlPoints, FloatArray, IntArray
from vgps.readers.table import Table, read_bytes, read_table

ENU = ("east_m", "north_m", "up_m")
_GEODETIC = ("latitude_deg", "longitude_deg", "height_m")
_PROJECTED = ("x", "y", "height_m")
_NAMES = {"x": ("x", "easting_m", "easting"), "y": ("y", "northing_m", "northing")}
_SIGMAS = ("sigma_east_m", "sigma_north_m", "sigma_up_m")
_ROLES = {"": False, "control": False, "gcp": False, "check": True, "checkpoint": True, "cp": True}
_LAST_FRAME = 2**31 - 1
_GCP_FIELDS = 6
_UTM = re.compile(r"WGS84\s+UTM\s+(\d{1,2})\s*([NS])", re.IGNORECASE)


@dataclass(frozen=True)
class PointSystem:
    """What the coordinates of control points are in: as for `coordinate_system`; None for WGS 84."""

    crs: str | None = None
    geoid: str | None = None


def read_control_points(
    path: str | Path, system: PointSystem | None = None, images: list[str] | None = None
) -> ControlPoints:
    """Read control and check points; a file whose name ends in ``.txt`` is in ODM's format.

    Args:
        path: The file.
        system: What its coordinates are in, unless it says so itself.
        images: Names of the recording's images, for ODM's format; None for a video, whose frames are numbered
            in the names as ``frame_000123.jpg``.

    Raises:
        RecordingError: The file is missing or empty, a column is missing, a cell is not a finite number, a
            frame is not an index, or a role is unknown.
        CoordinateSystemError: The coordinate system or geoid is unknown, or lacks its grid.
    """
    path, system = Path(path), system or PointSystem()
    if path.suffix.lower() == ".txt":
        return _read_gcp_list(path, system, images)
    table = read_table(path, RecordingError)
    columns, system = _position_columns(table, system)
    names = [table.require(name) for name in ("frame", "u_px", "v_px", *columns)]
    values = np.column_stack([table.numbers(name) for name in names])
    if len(values) == 0:
        raise RecordingError("no control points", file=path, expected="a row for each observation")
    _check(values, table.line, path, columns)
    marks, check, sigma_m = _names(table, values[:, 3:]), _roles(table), _sigmas(table)
    return _points(path, values, marks, check, sigma_m, system)


def _position_columns(table: Table, system: PointSystem) -> tuple[tuple[str, ...], PointSystem | None]:
    """Return the columns of the position and what they are in, None for ENU."""
    if table.find(*_GEODETIC[:2]) is not None:
        return _GEODETIC, replace(system, crs=None)
    first, second = (table.find(*_NAMES[axis]) for axis in ("x", "y"))
    if first is None or second is None:
        return ENU, None
    if system.crs is None:
        raise RecordingError(
            f"columns {first} and {second} of an unknown coordinate system",
            file=table.path,
            remedy="name it with --control-crs EPSG:NNNN",
        )
    return (first, second, "height_m"), system


def _check(values: FloatArray, line: IntArray, path: Path, columns: tuple[str, ...]) -> None:
    frame = values[:, 0]
    bad = ~np.isfinite(values).all(axis=1) | (frame < 0) | (frame > _LAST_FRAME) | (np.floor(frame) != frame)
    if columns == _GEODETIC:
        bad |= (np.abs(values[:, 3]) > 90) | (np.abs(values[:, 4]) > 180)
    if bad.any():
        raise RecordingError(
            "an impossible observation",
            file=path,
            place=f"line {line[int(np.flatnonzero(bad)[0])]}",
            expected=f"a frame index from 0 and finite {', '.join(('u_px', 'v_px', *columns))}",
        )


def _points(
    path: Path,
    values: FloatArray,
    names: list[str],
    check: BoolArray,
    sigma_m: FloatArray,
    system: PointSystem | None,
) -> ControlPoints:
    """Return the points with positions in ENU (no system), or converted to geodetic ones."""
    position, notes = values[:, 3:6], tuple[str, ...]()
    if system is not None:
        if system.crs is None:
            where = float(position[0, 0]), float(position[0, 1])
            position = position[:, [1, 0, 2]]
        else:
            where = place_in(system.crs, position[0])
        converter = coordinate_system(where, system.crs, system.geoid)
        position, notes = converter.to_geodetic(position), converter.notes
    return ControlPoints(
        name=tuple(names),
        frame=values[:, 0].astype(np.int64),
        uv_px=values[:, 1:3],
        world_p_point=position,
        sigma_m=sigma_m,
        check=check,
        geodetic=system is not None,
        source=path,
        notes=notes,
    )


def _names(table: Table, position: FloatArray) -> list[str]:
    column = table.find("name", "mark", "point", "label", "id")
    if column is not None:
        return table.text(column)
    return [str(1 + mark) for mark in np.unique(position, axis=0, return_inverse=True)[1].ravel().tolist()]


def _roles(table: Table) -> BoolArray:
    column = table.find("role", "type")
    if column is None:
        return np.zeros(len(table.line), bool)
    roles = [cell.lower() for cell in table.text(column)]
    for role, line in zip(roles, table.line.tolist(), strict=True):
        if role not in _ROLES:
            raise RecordingError(
                f"role {role!r}", file=table.path, place=f"line {line}", expected="control or check"
            )
    return np.array([_ROLES[role] for role in roles], bool)


def _sigmas(table: Table) -> FloatArray:
    """Return (N, 3) standard deviations; 0 where there is none."""
    columns = [
        np.zeros(len(table.line)) if table.find(name) is None else np.nan_to_num(table.numbers(name))
        for name in _SIGMAS
    ]
    sigma = np.column_stack(columns)
    wrong = (sigma < 0).any(axis=1)
    if wrong.any():
        line = table.line[int(np.flatnonzero(wrong)[0])]
        raise RecordingError(
            "a negative sigma", file=table.path, place=f"line {line}", expected="metres >= 0"
        )
    return sigma


def _read_gcp_list(path: Path, system: PointSystem, images: list[str] | None) -> ControlPoints:
    """Read ODM's list: the coordinate system, then ``x y z u v image [name]`` per observation."""
    text = read_bytes(path, RecordingError).decode("utf-8-sig", errors="replace")
    lines = [(n, line.split()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    rows = [(n, row) for n, row in lines[1:] if not row[0].startswith("#")]
    if not rows:
        raise RecordingError("no control points", file=path, expected="a row for each observation")
    parsed = [_gcp_row(row, line, path, images) for line, row in rows]
    names = [row[6] if len(row) > _GCP_FIELDS else " ".join(row[:3]) for _, row in rows]
    values, line = np.array(parsed), np.array([n for n, _ in rows])
    crs = _odm_crs(" ".join(lines[0][1]), path)
    _check(values, line, path, _PROJECTED)
    check, sigma_m = np.zeros(len(rows), bool), np.zeros((len(rows), 3))
    return _points(path, values, names, check, sigma_m, replace(system, crs=system.crs or crs))


def _odm_crs(header: str, path: Path) -> str:
    """Return the coordinate system that the first line names."""
    utm = _UTM.search(header)
    if utm is not None and 1 <= int(utm[1]) <= 60:
        return f"EPSG:{32600 + int(utm[1]) + 100 * (utm[2].upper() == 'S')}"
    if header.upper().startswith("EPSG:") or header.startswith("+proj"):
        return header
    raise RecordingError(
        f"{header!r} names no coordinate system",
        file=path,
        place="line 1",
        expected="EPSG:NNNN, a +proj string, or WGS84 UTM 32N",
    )


def _gcp_row(row: list[str], line: int, path: Path, images: list[str] | None) -> list[float]:
    """Return frame, u, v, x, y, z."""
    try:
        x, y, z, u, v = map(float, row[:5])
        image = row[5]
    except (ValueError, IndexError) as error:
        raise RecordingError(
            "not an observation", file=path, place=f"line {line}", expected="x y z u_px v_px image [name]"
        ) from error
    if images is not None:
        if image not in images:
            raise RecordingError(
                f"no image {image}", file=path, place=f"line {line}", expected="images of the recording"
            )
        return [images.index(image), u, v, x, y, z]
    number = re.search(r"(\d{1,9})\D*$", Path(image).stem)
    if number is None:
        raise RecordingError(
            f"no frame number in {image}", file=path, place=f"line {line}", expected="frame_000123.jpg"
        )
    return [int(number[1]), u, v, x, y, z]

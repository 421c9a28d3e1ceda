"""OGC GeoPackage 1.3 for QGIS and others: the path, a point per frame, and every fix with its verdict.

A GeoPackage is an SQLite database; geometries are ISO WKB with Z behind a header.
"""

import sqlite3
import struct
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from vgps.crs import CoordinateSystem, coordinate_system
from vgps.model import FloatArray
from vgps.writers.export_job import ExportJob

_APPLICATION_ID, _VERSION = 0x47504B47, 10300
_POINT_Z, _LINE_Z = 1001, 1002
_CUSTOM_SRS = 100000
_SCHEMA = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL,
  description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '', last_change DATETIME NOT NULL, min_x DOUBLE, min_y DOUBLE, max_x DOUBLE,
  max_y DOUBLE, srs_id INTEGER REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL UNIQUE REFERENCES gpkg_contents(table_name),
  column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL,
  m TINYINT NOT NULL, PRIMARY KEY (table_name, column_name));
INSERT INTO gpkg_spatial_ref_sys VALUES ('Undefined Cartesian', -1, 'NONE', -1, 'undefined', NULL);
INSERT INTO gpkg_spatial_ref_sys VALUES ('Undefined geographic', 0, 'NONE', 0, 'undefined', NULL);
"""
_LAST_CHANGE = "2000-01-01T00:00:00.000Z"  # the same run gives the same bytes


def write_geopackage(job: ExportJob, out: Path) -> None:
    """Write the layers ``path``, ``frames`` and ``fixes`` in the coordinate system asked for.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    system = job.georeferenced
    with closing(sqlite3.connect(out)) as base, base:
        base.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
        base.execute(f"PRAGMA user_version = {_VERSION}")
        base.executescript(_SCHEMA)
        srs_id = _add_system(base, system)
        layers = _Layers(base, srs_id, system.description)
        path = (_line(job.coordinates, srs_id), system.description)
        layers.add("path", "LINESTRING", {"coordinates": "TEXT"}, [path])
        _add_frames(layers, job)
        _add_fixes(layers, job)


class _Layers:
    """Feature tables of a GeoPackage."""

    def __init__(self, base: sqlite3.Connection, srs_id: int, description: str) -> None:
        self._base, self.srs_id, self._description = base, srs_id, description

    def add(self, name: str, kind: str, columns: dict[str, str], rows: Iterable[Sequence[object]]) -> None:
        """Add a table with a geometry and columns of given types; each row begins with its geometry."""
        declared = "".join(f", {column} {type_}" for column, type_ in columns.items())
        self._base.execute(f"CREATE TABLE {name} (fid INTEGER PRIMARY KEY, geom {kind}{declared})")
        marks = ", ".join("?" * (len(columns) + 1))
        self._base.executemany(
            f"INSERT INTO {name} (geom{''.join(f', {column}' for column in columns)}) VALUES ({marks})", rows
        )
        self._base.execute(
            "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change, srs_id) "
            "VALUES (?, 'features', ?, ?, ?, ?)",
            (name, name, self._description, _LAST_CHANGE, self.srs_id),
        )
        self._base.execute(
            "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)", (name, kind, self.srs_id)
        )


def _add_frames(layers: _Layers, job: ExportJob) -> None:
    columns = {
        "frame": "INTEGER",
        "image": "TEXT",
        "t_s": "REAL",
        "utc": "TEXT",
        "state": "TEXT",
        job.georeferenced.height_column.replace(".", "_"): "REAL",
        "heading_deg": "REAL",
        "sigma_east_m": "REAL",
        "sigma_north_m": "REAL",
        "sigma_up_m": "REAL",
    }
    solution, utc = job.solution, job.utc
    rows = zip(
        [_point(place, layers.srs_id) for place in job.coordinates],
        job.frame.tolist(),
        job.image_names,
        solution.t_s.tolist(),
        [None] * len(job.frame) if utc is None else [one.isoformat() for one in utc],
        map(str, solution.state),
        job.coordinates[:, 2].tolist(),
        _known(job.heading_deg),
        *(_known(column) for column in solution.sigma_position_m.T),
        strict=True,
    )
    layers.add("frames", "POINT", columns, rows)


def _add_fixes(layers: _Layers, job: ExportJob) -> None:
    if job.solution.judged_fixes is None:
        return
    log, table = job.solution.judged_fixes
    columns = {
        "line": "INTEGER",
        "t_s": "REAL",
        "class": "TEXT",
        "verdict": "TEXT",
        "reason": "TEXT",
        "probability": "REAL",
        "residual_east_m": "REAL",
        "residual_north_m": "REAL",
        "residual_up_m": "REAL",
        "r_m": "REAL",
        "h_m": "REAL",
    }
    geodetic = np.column_stack([log.latitude_deg, log.longitude_deg, log.height_m])
    places = job.georeferenced.from_geodetic(geodetic)
    rows = zip(
        [_point(place, layers.srs_id) for place in places],
        log.line.tolist(),
        log.t_s.tolist(),
        map(str, log.fix_class),
        map(str, table.verdict),
        table.reason,
        _known(table.probability),
        *(_known(column) for column in table.residual_m.T),
        _known(table.r_m),
        _known(table.h_m),
        strict=True,
    )
    layers.add("fixes", "POINT", columns, rows)


def _add_system(base: sqlite3.Connection, system: CoordinateSystem) -> int:
    """Add the system and WGS 84, and return its id: the EPSG code of the horizontal part if it has one."""
    wgs84 = coordinate_system((0.0, 0.0))
    rows = {4326: wgs84, system.epsg or _CUSTOM_SRS: system}
    for code, one in rows.items():
        organisation = "EPSG" if one.epsg else "NONE"
        base.execute(
            "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)",
            (one.name, code, organisation, code, one.horizontal_wkt1, one.description),
        )
    return system.epsg or _CUSTOM_SRS


def _point(place: FloatArray, srs_id: int) -> bytes | None:
    if not np.isfinite(place).all():
        return None
    return _header(srs_id) + struct.pack("<BI3d", 1, _POINT_Z, *place)


def _line(places: FloatArray, srs_id: int) -> bytes:
    start = _header(srs_id) + struct.pack("<BII", 1, _LINE_Z, len(places))
    return start + np.ascontiguousarray(places, "<f8").tobytes()


def _header(srs_id: int) -> bytes:
    """Return the header of a geometry: little-endian, without an envelope."""
    return struct.pack("<2sBBi", b"GP", 0, 1, srs_id)


def _known(values: FloatArray) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]

"""Export of run folders to the formats of other programs."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run
from vgps.solution import Solution
from vgps.writers import colmap
from vgps.writers.atomic import new_file, new_folder
from vgps.writers.gpx import write_gpx
from vgps.writers.kitti import write_kitti
from vgps.writers.maps import write_geojson, write_kml
from vgps.writers.nerfstudio import write_nerfstudio
from vgps.writers.ply import write_ply
from vgps.writers.tum import write_tum


def _tum(solution: Solution, out: Path) -> None:
    write_tum(solution.trajectory, out)


def _ply(solution: Solution, out: Path) -> None:
    write_ply(solution.landmarks, solution.observations, solution.world_origin, out)


FORMATS: dict[str, Callable[[Solution, Path], None]] = {
    "tum": _tum,
    "ply": _ply,
    "kitti": write_kitti,
    "nerfstudio": write_nerfstudio,
    "geojson": write_geojson,
    "kml": write_kml,
    "gpx": write_gpx,
    "colmap": colmap.write_colmap,
}
_ABOVE_SEA = {"gpx": write_gpx, "kml": write_kml}


def _with_geoid(to: str, geoid_m: float) -> Callable[[Solution, Path], None]:
    if to not in _ABOVE_SEA:
        raise RunFolderError(
            f"heights above the geoid in {to}",
            expected="--geoid with " + " or ".join(_ABOVE_SEA),
            remedy=f"omit --geoid: heights in {to} are those of the run, above the ellipsoid",
        )
    if not math.isfinite(geoid_m):
        raise RunFolderError(f"--geoid is {geoid_m}", expected="a number of metres")
    return partial(_ABOVE_SEA[to], geoid_m=geoid_m)


def export(run: Path, to: str, out: Path, geoid_m: float | None = None) -> None:
    """Export the run folder ``run`` in the format ``to``, one of :data:`FORMATS`.

    Args:
        run: A run folder.
        to: Name of the format; ``colmap`` makes a folder, every other format a file.
        out: The folder or file.
        geoid_m: Height of the geoid above the ellipsoid; heights in ``gpx`` and ``kml`` are then above it.

    Raises:
        RunFolderError: The run cannot be read or exported to the format, the format is unknown or has no
            heights above a geoid, ``geoid_m`` is not finite, or ``out`` cannot be written.
    """
    write = FORMATS.get(to)
    if write is None:
        raise RunFolderError(f"unknown format {to!r}", expected="one of " + ", ".join(sorted(FORMATS)))
    if geoid_m is not None:
        write = _with_geoid(to, geoid_m)
    solution = read_run(run)
    place = new_folder(out, colmap.FILES, colmap.MARK) if to == "colmap" else new_file(out)
    with place as scratch:
        write(solution, scratch)

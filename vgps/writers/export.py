"""Export of run folders to the formats of other programs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgps.crs import CoordinateSystem, coordinate_system, decimal_year
from vgps.crs.frames import poses_in_system, world_to_system
from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run
from vgps.solution import Solution, Trajectory
from vgps.writers import colmap, exif, splat
from vgps.writers.atomic import new_file, new_folder
from vgps.writers.export_job import ExportJob, ExportOptions, video_of
from vgps.writers.frame_choice import choose_frames, subset
from vgps.writers.geopackage import write_geopackage
from vgps.writers.geopose import write_geopose
from vgps.writers.gpx import write_gpx
from vgps.writers.kitti import write_kitti
from vgps.writers.las import write_las
from vgps.writers.mapillary import write_mapillary
from vgps.writers.maps import write_geojson, write_kml
from vgps.writers.nerfstudio import write_nerfstudio
from vgps.writers.ply import write_ply
from vgps.writers.pose_table import write_csv
from vgps.writers.tum import write_tum

__all__ = ["FORMATS", "ExportOptions", "Format", "export"]


@dataclass(frozen=True, kw_only=True)
class Format:
    """A format to export to.

    Attributes:
        write: Writes a job to a file or folder.
        crs, geoid: Whether it can have other coordinates, and heights above a geoid.
        folder: Names in the folder that it is, and the one that marks it; None for a file.
        columns: Whether it has columns to choose.
    """

    write: Callable[[ExportJob, Path], None]
    crs: bool = False
    geoid: bool = False
    folder: tuple[tuple[str, ...], str] | None = None
    columns: bool = False


def _tum(job: ExportJob, out: Path) -> None:
    poses, origin, system = job.solution.world_T_camera, job.solution.world_origin, job.system
    if _is_world(job) or origin is None or system is None:
        write_tum(Trajectory(job.solution.t_s, poses), out)
        return
    header = (
        f"t_s x y z qx qy qz qw  (x, y, z are {', '.join(system.axes)}: {system.description}; rotations are "
    )
    header += "from the camera to these axes)"
    write_tum(Trajectory(job.solution.t_s, poses_in_system(system, origin, poses)), out, header)


def _ply(job: ExportJob, out: Path) -> None:
    solution, origin, system = job.solution, job.solution.world_origin, job.system
    (marks, observations), about = solution.all_landmarks, None
    if not _is_world(job) and origin is not None and system is not None:
        marks = replace(marks, world_p_landmark=world_to_system(system, origin, marks.world_p_landmark))
        about = f"{', '.join(system.axes)}: {system.description}"
    write_ply(marks, observations, origin, out, about)


def _is_world(job: ExportJob) -> bool:
    """Whether coordinates are those of the run's own world frame."""
    return job.options.crs is None and job.options.geoid is None


FORMATS: dict[str, Format] = {
    "tum": Format(write=_tum, crs=True, geoid=True),
    "ply": Format(write=_ply, crs=True, geoid=True),
    "kitti": Format(write=lambda job, out: write_kitti(job.solution, out)),
    "nerfstudio": Format(write=lambda job, out: write_nerfstudio(job.solution, out, job.image_names)),
    "geojson": Format(write=write_geojson),
    "kml": Format(write=write_kml, geoid=True),
    "gpx": Format(write=write_gpx, geoid=True),
    "csv": Format(write=write_csv, crs=True, geoid=True, columns=True),
    "las": Format(write=write_las, crs=True, geoid=True),
    "gpkg": Format(write=write_geopackage, crs=True, geoid=True),
    "geopose": Format(write=write_geopose),
    "mapillary": Format(write=write_mapillary, geoid=True),
    "colmap": Format(
        write=lambda job, out: colmap.write_colmap(job.solution, out, job.image_names),
        folder=(colmap.FILES, colmap.MARK),
    ),
    "splat": Format(write=splat.write_splat, crs=True, geoid=True, folder=(splat.FILES, splat.MARK)),
    "exif": Format(write=exif.write_exif, geoid=True, folder=((exif.MARK,), exif.MARK)),
}


def export(run: Path, to: str, out: Path, options: ExportOptions | None = None) -> CoordinateSystem | None:
    """Export the run folder ``run`` in the format ``to``, one of :data:`FORMATS`.

    Args:
        run: A run folder.
        to: Name of the format.
        out: The file, or the folder for ``colmap``, ``splat`` and ``exif``.
        options: Coordinate system, geoid, frames, columns.

    Returns:
        What coordinates are in; None if the run is not georeferenced.

    Raises:
        RunFolderError: The run cannot be read or exported to the format, the format is unknown or has no such
            option, or ``out`` cannot be written.
        CoordinateSystemError: The coordinate system or geoid is unknown, or lacks its grid.
    """
    options = options or ExportOptions()
    chosen = FORMATS.get(to)
    if chosen is None:
        raise RunFolderError(f"unknown format {to!r}", expected="one of " + ", ".join(sorted(FORMATS)))
    _check_options(to, chosen, options)
    job = _job(read_run(run), options, out)
    place = new_file(out) if chosen.folder is None else new_folder(out, *chosen.folder)
    with place as scratch:
        chosen.write(job, scratch)
    return job.system


def _check_options(to: str, chosen: Format, options: ExportOptions) -> None:
    asked = {
        "crs": (options.crs or options.gps_crs, "its coordinates are prescribed"),
        "geoid": (options.geoid, "its heights are above the ellipsoid"),
        "columns": (options.columns, "it has no columns to choose"),
    }
    for name, (value, reason) in asked.items():
        if value is not None and not getattr(chosen, name):
            having = [other for other, one in FORMATS.items() if getattr(one, name)]
            raise RunFolderError(
                f"--{name} for {to}: {reason}", expected=f"--{name} with " + ", ".join(having)
            )


def _job(solution: Solution, options: ExportOptions, out: Path) -> ExportJob:
    system = _system(solution, options)
    video = None
    if options.choice.select == "sharp":
        video = video_of(solution, options.images, len(solution.t_s) - 1)
    frame = choose_frames(solution, options.choice, video)
    chosen = subset(solution, frame)
    return ExportJob(solution=chosen, frame=frame, system=system, options=options, out=out)


def _system(solution: Solution, options: ExportOptions) -> CoordinateSystem | None:
    origin = solution.world_origin
    if origin is None or not solution.georeferenced:
        if options.crs is not None or options.geoid is not None:
            raise RunFolderError("--crs or --geoid for a run that is not georeferenced", remedy="omit them")
        return None
    start = solution.video_start_utc
    epoch = np.inf if start is None else decimal_year(start)
    return coordinate_system(origin[:2], options.crs, options.geoid, source=options.gps_crs, epoch=epoch)

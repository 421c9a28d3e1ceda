"""The verb ``export``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vgps.cli.app import print_line, print_note
from vgps.cli.options import CoordinateOptions
from vgps.writers.frame_choice import FrameChoice

_COORDINATES = CoordinateOptions()


def export(
    run: Path,
    *,
    to: str,
    out: Path,
    coordinates: CoordinateOptions = _COORDINATES,
    frames: Annotated[FrameChoice | None, Parameter(name="*")] = None,
    columns: str | None = None,
    images: Path | None = None,
) -> None:
    """Write a run in another format.

    Args:
        run: Run folder.
        to: colmap, splat, exif (folders); nerfstudio, tum, kitti, geojson, kml, gpx, ply, csv, las, gpkg,
            geopose or mapillary (files).
        out: File or folder to write.
        coordinates: Coordinate system.
        frames: Choice of frames.
        columns: Columns of csv, separated by commas; x, y, height stand for those of the coordinate system.
        images: Recording, video or folder of images with the frames, if it is not where the run says.
    """
    from vgps.writers.export import ExportOptions
    from vgps.writers.export import export as export_run

    options = ExportOptions(
        crs=coordinates.crs,
        geoid=coordinates.geoid,
        gps_crs=coordinates.gps_crs,
        choice=frames or FrameChoice(),
        columns=None if columns is None else tuple(columns.split(",")),
        images=images,
    )
    system = export_run(run, to, out, options)
    if system is not None and (coordinates.crs or coordinates.geoid):
        for note in system.notes:
            print_note(note)
        print_line(f"wrote {out}: {system.description}")
    else:
        print_line(f"wrote {out}")

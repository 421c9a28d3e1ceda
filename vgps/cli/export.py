"""The verb ``export``."""

from pathlib import Path

from vgps.cli.app import app, print_line
from vgps.writers.export import export as export_run


@app.command
def export(run: Path, *, to: str, out: Path, geoid: float | None = None) -> None:
    """Write a run in another format.

    Args:
        run: Run folder.
        to: colmap (a folder), nerfstudio, tum, kitti, geojson, kml, gpx or ply.
        out: File or folder to write.
        geoid: Height of the geoid above the ellipsoid [m]; heights in gpx and kml are then above the geoid.
    """
    export_run(run, to, out, geoid)
    print_line(f"wrote {out}")

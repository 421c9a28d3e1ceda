"""Verbs that write recordings and runs for others."""

from pathlib import Path

from vgps.cli.app import app, say
from vgps.writers.export import export as export_run


@app.command
def simulate(
    *,
    out: Path,
    scene: str = "walk",
    seed: int = 0,
    gps_errors: Path | None = None,
    gps_reference: Path | None = None,
) -> None:
    """Make a recording with exact truth: video, GPS, gyro, calibration.

    Args:
        out: Recording folder to write.
        scene: walk (70 m, hand-held, as in the thesis), drive, demo or spin.
        seed: Of the world and of the sensors' errors.
        gps_errors: Log of a receiver that stands still, whose errors are replayed in place of simulated ones.
        gps_reference: Better log of the same antenna, if that receiver moves: the truth where it is RTK-fix.
    """
    from vgps.simulate import scene_with_errors  # noqa: PLC0415  (slow to import)
    from vgps.simulate import simulate as simulate_recording  # noqa: PLC0415

    simulate_recording(out, scene_with_errors(scene, gps_errors, gps_reference), seed)
    say(f"wrote {out}")


@app.command
def export(run: Path, *, to: str, out: Path, geoid: float | None = None) -> None:
    """Write a run in another format.

    Args:
        run: Run folder.
        to: colmap (a folder), nerfstudio, tum, kitti, geojson, kml, gpx or ply.
        out: File or folder to write.
        geoid: Height of the geoid above the ellipsoid there, metres; gpx and kml then have heights above it.
    """
    export_run(run, to, out, geoid)
    say(f"wrote {out}")

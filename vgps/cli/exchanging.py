"""Verbs that write recordings and runs for others."""

from pathlib import Path

from rich.console import Console

import vgps.simulate
from vgps.cli.app import app
from vgps.writers.export import export as export_run


@app.command
def simulate(*, out: Path, scene: str = "walk", seed: int = 0) -> None:
    """Make a recording with exact truth: video, GPS, gyro, calibration.

    Args:
        out: Recording folder to write.
        scene: walk (70 m, hand-held, as in the thesis), drive, demo or spin.
        seed: Of the world and of the sensors' errors.
    """
    vgps.simulate.simulate(out, scene, seed)
    Console().print(f"wrote {out}", highlight=False)


@app.command
def export(run: Path, *, to: str, out: Path) -> None:
    """Write a run in another format.

    Args:
        run: Run folder.
        to: colmap (a folder), nerfstudio, tum, kitti, geojson, kml or ply.
        out: File or folder to write.
    """
    export_run(run, to, out)
    Console().print(f"wrote {out}", highlight=False)

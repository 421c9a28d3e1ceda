"""The verb that shows a run."""

from pathlib import Path

from rich.console import Console

from vgps.cli.app import app
from vgps.errors import VgpsError
from vgps.model import Recording
from vgps.readers.recording import open_recording
from vgps.readers.run_folder import read_run
from vgps.solution import Solution
from vgps.viewer import inspect_run


@app.command
def inspect(run: Path, *, save: Path | None = None, screenshot: Path | None = None) -> None:
    """Look at a run: video with reprojections, scene with regions of fixes, factor graph, plots, map.

    Args:
        run: Run folder.
        save: Write a rerun recording (.rrd) instead of opening a window; `rerun F.rrd` shows it.
        screenshot: Write a picture (.png), drawn without a window.
    """
    solution, console = read_run(run), Console()
    for note in inspect_run(solution, _recording(solution, console), save=save, screenshot=screenshot):
        console.print(f"[yellow]note:[/yellow] {note}", highlight=False, soft_wrap=True)
    for written in (save, screenshot):
        if written is not None:
            console.print(f"wrote {written}", highlight=False, soft_wrap=True)


def _recording(solution: Solution, console: Console) -> Recording | None:
    """What the run was made from, for its video; it may be gone."""
    if solution.recording is None:
        return None
    try:
        return open_recording(solution.recording, with_gps=False)
    except VgpsError as error:
        console.print(
            f"[yellow]note:[/yellow] without the video: {error}", highlight=False, soft_wrap=True, markup=True
        )
        return None

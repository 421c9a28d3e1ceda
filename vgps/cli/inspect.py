"""The verb that shows a run."""

from pathlib import Path

from vgps.cli.app import app, note, say
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
    solution = read_run(run)
    for words in inspect_run(solution, _recording(solution), save=save, screenshot=screenshot):
        note(words)
    for written in (save, screenshot):
        if written is not None:
            say(f"wrote {written}")


def _recording(solution: Solution) -> Recording | None:
    """What the run was made from, for its video; it may be gone."""
    if solution.recording is None:
        return None
    try:
        return open_recording(solution.recording, with_gps=False)
    except VgpsError as error:
        note(f"without the video: {error}")
        return None

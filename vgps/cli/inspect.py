"""The verb ``inspect``."""

from pathlib import Path
from typing import TYPE_CHECKING

from vgps.cli.app import print_line, print_note
from vgps.errors import VgpsError

if TYPE_CHECKING:
    from vgps.model import Recording
    from vgps.solution import Solution


def inspect(run: Path, *, save: Path | None = None, screenshot: Path | None = None) -> None:
    """Show a run in the rerun viewer: video with reprojections, 3-D scene, factor graph, plots and map.

    Args:
        run: Run folder.
        save: Write a rerun recording (.rrd) instead of opening a window; `rerun F.rrd` shows it.
        screenshot: Write a picture (.png) instead of opening a window.
    """
    from vgps.readers.run_folder import read_run
    from vgps.viewer import inspect_run

    solution = read_run(run)
    for text in inspect_run(solution, _recording(solution), save=save, screenshot=screenshot):
        print_note(text)
    for written in (save, screenshot):
        if written is not None:
            print_line(f"wrote {written}")


def _recording(solution: "Solution") -> "Recording | None":
    """Open the recording of the run for its video; it may no longer exist."""
    from vgps.readers.recording import open_recording
    from vgps.readers.views.steady import as_posed

    if solution.recording is None:
        return None
    try:
        recording = open_recording(solution.recording, with_gps=False, cameras=False)
        return as_posed(recording, solution.camera)
    except VgpsError as error:
        print_note(f"shown without the video: {error}")
        return None

"""A run to look at: video, scene, factor graph, plots and map in one rerun recording; needs rerun-sdk."""

from pathlib import Path

from vgps.model import Recording
from vgps.solution import Solution

__all__ = ["inspect_run"]


def inspect_run(
    solution: Solution,
    recording: Recording | None = None,
    *,
    save: Path | None = None,
    screenshot: Path | None = None,
) -> tuple[str, ...]:
    """Show a run in the rerun viewer, or write what the viewer would show.

    Args:
        solution: The run.
        recording: What it was made from, for its video; without it the features are shown on black.
        save: ``.rrd`` file to write, for `rerun F.rrd`.
        screenshot: ``.png`` file to write, drawn without a window.

    Returns:
        What could not be shown, a line each. With neither file a window opens.

    Raises:
        ViewerError: There is no display for a window, or nothing that can draw.
        RunFolderError: A file cannot be written.
    """
    from vgps.viewer.recording import show  # noqa: PLC0415  (importing rerun takes two seconds)

    return show(solution, recording, save, screenshot)

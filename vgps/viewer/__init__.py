"""A run in the rerun viewer: video, scene, factor graph, plots and map on one timeline."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from vgps.errors import ViewerError
from vgps.model import Recording
from vgps.solution import Solution

if TYPE_CHECKING:
    from vgps.viewer.live import LiveView

__all__ = ["inspect_run", "open_live_view"]


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
        recording: The recording of the run, for its video; without it the features are shown on black.
        save: ``.rrd`` file to write, for `rerun F.rrd`.
        screenshot: ``.png`` file to write, drawn without a window. With neither file a window opens.

    Returns:
        What could not be shown, a line each.

    Raises:
        ViewerError: The extra ``viewer`` is not installed, there is no display for a window, or no graphics
            driver to draw with.
        RunFolderError: A file cannot be written, or has another suffix.
    """
    with _explained():
        from vgps.viewer.rerun_recording import show  # noqa: PLC0415  (importing rerun takes two seconds)

    return show(solution, recording, save, screenshot)


def open_live_view() -> "LiveView":
    """Open a window that shows poses as they come.

    Raises:
        ViewerError: As :func:`inspect_run`.
    """
    with _explained():
        from vgps.viewer.live import live_window  # noqa: PLC0415

    return live_window()


@contextlib.contextmanager
def _explained() -> Iterator[None]:
    """Explain that rerun is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != "rerun":
            raise
        raise ViewerError("the viewer is not installed", remedy='pip install "vgps[viewer]"') from error

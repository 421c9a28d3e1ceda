"""A run into one rerun recording: to a window, a file or a picture."""

import os
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

import numpy as np
import rerun as rr

from vgps.errors import VgpsError, ViewerError
from vgps.model import Recording
from vgps.solution import Solution, Verdict
from vgps.viewer.blueprint import blueprint
from vgps.viewer.chase import log_chase
from vgps.viewer.columns import Sheet
from vgps.viewer.features import log_features
from vgps.viewer.graph import log_graph
from vgps.viewer.map_view import log_map
from vgps.viewer.measures import observations
from vgps.viewer.plots import log_plots, log_summary
from vgps.viewer.scene import IMAGE, log_scene
from vgps.viewer.screenshot import NO_ANSWER, answering_viewer, take_screenshot
from vgps.viewer.video import log_video
from vgps.writers.atomic import new_file

_APPLICATION, _PORT = "vgps", 9876
_REMEDY = "write a file with --save F.rrd, which rerun opens, or a picture with --screenshot F.png"


def show(
    solution: Solution, recording: Recording | None, save: Path | None, screenshot: Path | None
) -> tuple[str, ...]:
    """As :func:`vgps.viewer.inspect_run`."""
    notes: tuple[str, ...] = ()
    if save is None and screenshot is None:
        notes = _open_window(solution, recording)
    if save is not None:
        with new_file(save) as file:
            notes = write(file, solution, recording)
    if screenshot is not None:
        with new_file(screenshot) as picture, tempfile.TemporaryDirectory(prefix="vgps-") as folder:
            file = Path(folder) / "run.rrd"
            notes = write(file, solution, recording, for_picture=True)
            take_screenshot(file, picture, shown_time_s(solution))
    return notes


def write(
    file: Path, solution: Solution, recording: Recording | None, for_picture: bool = False
) -> tuple[str, ...]:
    """Write a run as a ``.rrd`` file; returns what could not be shown."""
    stream = rr.RecordingStream(_APPLICATION)
    stream.save(file)
    notes = fill(stream, solution, recording, for_picture)
    stream.flush()
    stream.disconnect()
    return notes


def fill(
    stream: rr.RecordingStream, solution: Solution, recording: Recording | None, for_picture: bool = False
) -> tuple[str, ...]:
    """Log everything to a stream, layout first; returns what could not be shown."""
    sheet, seen, notes = Sheet(stream, solution.t_s), observations(solution), list[str]()
    on_earth = solution.world_origin if solution.georeferenced else None
    stream.send_blueprint(blueprint(solution, on_earth is not None, for_picture))
    log_scene(sheet, solution)
    log_chase(sheet, solution)
    log_plots(sheet, solution, seen)
    log_graph(sheet, solution, seen)
    if on_earth is not None:
        log_map(sheet, solution, on_earth)
    log_features(sheet, seen)
    if recording is not None:
        try:
            notes.extend(log_video(sheet, f"{IMAGE}/video", recording.video))
        except VgpsError as error:
            notes.append(f"the video is not shown: {error}")
    log_summary(sheet, solution, tuple(notes))
    return tuple(notes)


def shown_time_s(solution: Solution) -> float:
    """The time of the picture: the first rejected fix within the video, else the middle of the run."""
    table = solution.fixes
    if table is not None and solution.gps is not None:
        rejected = [
            float(t)
            for t, verdict in zip(solution.fix_times_s, table.verdict, strict=True)
            if verdict is Verdict.REJECTED and solution.t_s[0] <= t <= solution.t_s[-1]
        ]
        if rejected:
            return rejected[0]
    return float(np.median(solution.t_s))


def _open_window(solution: Solution, recording: Recording | None) -> tuple[str, ...]:
    _check_display()
    stream = rr.RecordingStream(_APPLICATION)
    # the viewer comes with the SDK, in the same environment, which need not be on the PATH
    beside = shutil.which("rerun", path=sysconfig.get_path("scripts"))
    try:
        rr.spawn(
            connect=False,
            executable_path=beside,
            hide_welcome_screen=True,
            port=_PORT,
            recording=stream,
        )
        answering_viewer(_PORT)
    except NO_ANSWER as error:
        raise ViewerError(
            f"the viewer does not start ({str(error).splitlines()[0]})", remedy=_REMEDY
        ) from error
    stream.connect_grpc(f"rerun+http://127.0.0.1:{_PORT}/proxy")
    notes = fill(stream, solution, recording)
    stream.flush()
    return notes


def _check_display() -> None:
    """Raise ViewerError where no window can open."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ViewerError(
            "no display to open a window on",
            expected="DISPLAY or WAYLAND_DISPLAY to be set",
            remedy=_REMEDY,
        )

"""A run as a rerun recording: in a window, a file or a picture."""

import errno
import os
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

import numpy as np
import rerun as rr

from vgps.errors import RunFolderError, VgpsError, ViewerError
from vgps.model import Recording
from vgps.solution import Solution, Verdict
from vgps.viewer.blueprint import blueprint
from vgps.viewer.chase_camera import log_chase_camera
from vgps.viewer.features import log_features, log_left_out
from vgps.viewer.geo_map import log_map
from vgps.viewer.graph import log_graph
from vgps.viewer.plots import log_plots
from vgps.viewer.residuals import reproject
from vgps.viewer.run_stream import RunStream
from vgps.viewer.scene import IMAGE, log_scene
from vgps.viewer.screenshot import NO_ANSWER, connect, take_screenshot
from vgps.viewer.summary import log_summary
from vgps.viewer.video import log_video
from vgps.writers.atomic import new_file

_APPLICATION, _PORT = "vgps", 9876
_REMEDY = "write a file with --save F.rrd for rerun F.rrd, or a picture with --screenshot F.png"


def show(
    solution: Solution, recording: Recording | None, save: Path | None, screenshot: Path | None
) -> tuple[str, ...]:
    """Do what :func:`vgps.viewer.inspect_run` documents."""
    _check_suffix(save, ".rrd")
    _check_suffix(screenshot, ".png")
    notes: tuple[str, ...] = ()
    if save is None and screenshot is None:
        notes = _open_window(solution, recording)
    if save is not None:
        with new_file(save) as file:
            notes = write(file, solution, recording)
    if screenshot is not None:
        with new_file(screenshot) as picture, tempfile.TemporaryDirectory(prefix="vgps-") as folder:
            file = Path(folder) / "run.rrd"
            t_s = screenshot_time_s(solution)
            notes = write(file, solution, recording, picture_s=t_s)
            take_screenshot(file, picture, t_s)
    return notes


def write(
    file: Path, solution: Solution, recording: Recording | None, picture_s: float | None = None
) -> tuple[str, ...]:
    """Write a run as a ``.rrd`` file; return what could not be shown.

    Args:
        file: The file.
        solution: The run.
        recording: Its recording, if it still exists.
        picture_s: The file is for a picture at this time only.
    """
    stream = rr.RecordingStream(_APPLICATION)
    stream.save(file)
    notes = _log_run(stream, solution, recording, picture_s)
    try:
        stream.flush()
    except RuntimeError as error:  # rerun writes in a thread of its own, and does not say what it met
        raise OSError(errno.EIO, f"the viewer's writer stopped: {error}") from error
    stream.disconnect()
    return notes


def _log_run(
    stream: rr.RecordingStream,
    solution: Solution,
    recording: Recording | None,
    picture_s: float | None = None,
) -> tuple[str, ...]:
    """Log everything to a stream, the layout first; arguments and result as in `write`."""
    run, observations, notes = RunStream(stream, solution.t_s), reproject(solution), list[str]()
    world_origin = solution.world_origin if solution.georeferenced else None
    stream.send_blueprint(blueprint(solution, world_origin is not None, for_picture=picture_s is not None))
    log_scene(run, solution)
    log_chase_camera(run, solution.trajectory)
    log_plots(run, solution, observations)
    log_graph(run, solution, observations)
    if world_origin is not None:
        log_map(run, solution, world_origin)
    log_features(run, observations)
    log_left_out(run, solution)
    if recording is not None:
        try:
            notes.extend(log_video(run, f"{IMAGE}/video", recording.video, still_s=picture_s))
        except VgpsError as error:
            notes.append(f"the video is not shown: {error}")
    log_summary(run, solution, tuple(notes))
    return tuple(notes)


def screenshot_time_s(solution: Solution) -> float:
    """Return the time of the first rejected fix within the video, or the middle of the run without one."""
    if solution.fixes is not None:
        rejected = [
            float(t)
            for t, verdict in zip(solution.fix_times_s, solution.fixes.verdict, strict=True)
            if verdict is Verdict.REJECTED and solution.t_s[0] <= t <= solution.t_s[-1]
        ]
        if rejected:
            return rejected[0]
    return float(np.median(solution.t_s))


def _open_window(solution: Solution, recording: Recording | None) -> tuple[str, ...]:
    stream = opened_window(_REMEDY)
    notes = _log_run(stream, solution, recording)
    stream.flush()
    return notes


def opened_window(remedy: str) -> rr.RecordingStream:
    """Return a stream to a new window.

    Raises:
        ViewerError: There is no display, or the viewer does not start; the remedy says what to do instead.
    """
    _check_display(remedy)
    stream = rr.RecordingStream(_APPLICATION)
    # the SDK installs the viewer in the same environment, which need not be on the PATH
    viewer = shutil.which("rerun", path=sysconfig.get_path("scripts"))
    try:
        rr.spawn(
            connect=False,
            executable_path=viewer,
            hide_welcome_screen=True,
            port=_PORT,
            recording=stream,
        )
        connect(_PORT)
    except NO_ANSWER as error:
        raise ViewerError(
            f"the viewer did not start ({str(error).splitlines()[0]})", remedy=remedy
        ) from error
    stream.connect_grpc(f"rerun+http://127.0.0.1:{_PORT}/proxy")
    return stream


def _check_suffix(file: Path | None, suffix: str) -> None:
    if file is not None and file.suffix.lower() != suffix:
        raise RunFolderError("has the wrong suffix", file=file, expected=f"a name that ends in {suffix}")


def _check_display(remedy: str) -> None:
    """Raise ViewerError if no window can be opened."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ViewerError(
            "no display to open a window on",
            expected="DISPLAY or WAYLAND_DISPLAY to be set",
            remedy=remedy,
        )

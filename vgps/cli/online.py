"""The verb that poses a video while it runs."""

import sys
import threading
from pathlib import Path

from rich.console import Console

from vgps.cli.app import app
from vgps.config import GpsModel, read_config
from vgps.online import OnlineSmoother
from vgps.online.output import JsonLines
from vgps.online.replay import replay
from vgps.online.run import run_online, stopped_by_signals
from vgps.readers.recording import open_recording
from vgps.writers.run_folder import check_writable, write_run


@app.command
def online(
    recording: Path,
    *,
    gps: str | None = None,
    out: Path | None = None,
    finish: bool = False,
    realtime: bool = False,
    gps_model: GpsModel | None = None,
    survey: Path | None = None,
    config: Path | None = None,
    camera: str | None = None,
    rig: str | None = None,
    seed: int | None = None,
) -> None:
    """Pose a video while it runs: a line of JSON per frame, and per event, on standard output.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log, or a video with these beside it.
        gps: GPS log, a path or a name inside the folder.
        out: Run folder to write at the end, at Ctrl-C too.
        finish: Keep everything and run stage D at the end, as `smooth` does.
        realtime: At the recording's own pace, else as fast as possible.
        gps_model: How a fix acts on the path; a cylinder around it by default.
        survey: YAML with the region r_m, h_m of each fix class.
        config: YAML that overrides the defaults.
        camera: Another camera.yaml; a path or a name inside the folder.
        rig: Another rig.yaml; a path or a name inside the folder.
        seed: Of every random choice.
    """
    if out is not None:
        check_writable(out)
    settings = read_config(config).with_gps(gps_model, survey).with_seed(seed)
    opened = open_recording(recording, gps=gps, camera=camera, rig=rig)
    smoother = OnlineSmoother(opened.camera, opened.rig, settings, keep_all=finish, source=opened.path)
    lines, stop = JsonLines(sys.stdout, opened.rig.video_start_utc), threading.Event()
    with stopped_by_signals(stop):
        frames = run_online(replay(opened, stop, realtime=realtime), smoother, lines.write, stop)
    console = Console(stderr=True)
    if out is not None:
        write_run(smoother.finish(stage_d=finish), out)
    console.print(f"{frames} frames" + (f": {out}" if out else ""), highlight=False, soft_wrap=True)

"""The verb that localizes a recording against a landmark database."""

from pathlib import Path
from typing import Literal

from vgps.cli.app import app, note, say
from vgps.cli.terminal import TerminalProgress
from vgps.config import read_config
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization import localize
from vgps.readers.recording import open_recording
from vgps.runtime.timing import one_after_another
from vgps.solution import FrameState
from vgps.writers.run_folder import check_writable, write_run


@app.command
def track(
    recording: Path,
    *,
    landmarks: Path,
    out: Path,
    estimator: Literal["frame", "graph"] | None = None,
    config: Path | None = None,
    camera: str | None = None,
    rig: str | None = None,
) -> None:
    """Localize a recording against landmarks seen before, with its gyro and without GPS.

    Args:
        recording: Folder with video, camera.yaml, and if there are any rig.yaml and gyro.csv.
        landmarks: Database, as `vgps landmarks build` writes it.
        out: Run folder to write.
        estimator: Pose each frame by itself, or the last second's frames together (graph, the default).
        config: YAML that overrides the defaults.
        camera: Another camera.yaml, a path or a name inside the folder.
        rig: Another rig.yaml, a path or a name inside the folder.
    """
    check_writable(out)
    settings = read_config(config).with_estimator(estimator)
    opened = open_recording(recording, camera=camera, rig=rig, with_gps=False)
    with LandmarkDatabase.open(landmarks, settings.localization.selection) as database:
        solution = localize(opened, database, settings, TerminalProgress())
    write_run(solution, out)
    for warning in solution.warnings:
        note(warning)
    frames, seconds = len(solution.t_s), one_after_another(solution.seconds)
    held = solution.state.count(FrameState.TRACKED)
    speed = f"{seconds:.1f} s ({frames / max(seconds, 1e-9):.1f} frames/s)"
    say(f"{held} of {frames} frames tracked, {speed}: {out}")

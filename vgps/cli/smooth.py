"""The verb ``smooth``."""

from pathlib import Path

from vgps.cli.app import app, print_line, print_note
from vgps.cli.options import GpsSettings, RecordingFiles
from vgps.cli.terminal import TerminalProgress
from vgps.evaluation.check_points import summary_line
from vgps.pipeline.offline import smooth as smooth_recording
from vgps.readers.control_points import PointSystem
from vgps.readers.recording import open_recording
from vgps.runtime.timing import sequential_seconds
from vgps.solution import Solution
from vgps.writers.run_folder import check_writable, write_run

_FILES, _SETTINGS = RecordingFiles(), GpsSettings()


@app.command
def smooth(
    recording: Path,
    *,
    out: Path,
    files: RecordingFiles = _FILES,
    settings: GpsSettings = _SETTINGS,
) -> None:
    """Estimate the pose of every frame of a recording in world coordinates.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log, or a video with these beside it.
        out: Run folder to write.
        files: Other files.
        settings: Settings.
    """
    check_writable(out)
    config = settings.read()
    opened = open_recording(
        recording,
        gps=files.gps,
        camera=files.camera,
        rig=files.rig,
        control_points=files.control_points,
        control_system=PointSystem(files.control_crs, files.control_geoid),
        image_topic=files.image_topic,
    )
    solution = smooth_recording(opened, config, TerminalProgress())
    write_run(solution, out)
    print_summary(solution, out)


def print_summary(solution: Solution, out: Path) -> None:
    """Print the warnings of a run, its numbers of frames and fixes, and its speed."""
    for warning in solution.warnings:
        print_note(warning)
    frames, seconds = len(solution.t_s), sequential_seconds(solution.seconds)
    used = 0 if solution.fixes is None else int(solution.fixes.used.sum())
    logged = 0 if solution.gps is None else len(solution.gps)
    speed = f"{seconds:.1f} s ({frames / max(seconds, 1e-9):.1f} frames/s)"
    if (checked := summary_line(solution)) is not None:
        print_line(checked)
    print_line(f"{frames} frames posed, {used} of {logged} fixes used, {speed}: {out}")

"""The verb ``smooth``."""

from pathlib import Path

from vgps.cli.app import print_line, print_note
from vgps.cli.options import GpsSettings, RecordingFiles
from vgps.solution import Solution

_FILES, _SETTINGS = RecordingFiles(), GpsSettings()


def smooth(
    recording: Path,
    *,
    out: Path,
    files: RecordingFiles = _FILES,
    settings: GpsSettings = _SETTINGS,
    resume: bool = False,
) -> None:
    """Estimate the pose of every frame of a recording in world coordinates.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log, or a video with these beside it.
        out: Run folder to write.
        files: Other files.
        settings: Settings.
        resume: Go on where an interrupted run with the same options left off.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.pipeline.checkpoint import Checkpoint
    from vgps.pipeline.offline import smooth as smooth_recording
    from vgps.readers.control_points import PointSystem
    from vgps.readers.recording import open_recording
    from vgps.writers.claim import claimed
    from vgps.writers.run_folder import check_writable, write_run

    check_writable(out)
    config = settings.read()
    with claimed(out):
        opened = open_recording(
            recording,
            gps=files.gps,
            camera=files.camera,
            rig=files.rig,
            imu=files.imu,
            control_points=files.control_points,
            control_system=PointSystem(files.control_crs, files.control_geoid),
            image_topic=files.image_topic,
        )
        checkpoint = Checkpoint(out, opened, config, resume=resume)
        solution = smooth_recording(opened, config, TerminalProgress(), checkpoint)
        write_run(solution, out)
        checkpoint.remove()
    print_summary(solution, out)


def print_summary(solution: Solution, out: Path) -> None:
    """Print the warnings of a run, its numbers of frames and fixes, and its speed."""
    from vgps.evaluation.check_points import summary_line
    from vgps.runtime.timing import sequential_seconds

    for warning in solution.warnings:
        print_note(warning)
    frames, seconds = len(solution.t_s), sequential_seconds(solution.seconds)
    used = 0 if solution.fixes is None else int(solution.fixes.used.sum())
    logged = 0 if solution.gps is None else len(solution.gps)
    speed = f"{seconds:.1f} s ({frames / max(seconds, 1e-9):.1f} frames/s)"
    if (checked := summary_line(solution)) is not None:
        print_line(checked)
    if len(solution.loops):
        print_line(f"{len(solution.loops)} frames tied to earlier visits of the same places")
    print_line(f"{frames} frames posed, {used} of {logged} fixes used, {speed}: {out}")

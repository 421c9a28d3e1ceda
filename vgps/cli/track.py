"""The verb ``track``."""

from pathlib import Path
from typing import Literal

from vgps.cli.app import print_line, print_note
from vgps.cli.options import SensorFiles

_FILES = SensorFiles()


def track(
    recording: Path,
    *,
    landmarks: Path,
    out: Path,
    estimator: Literal["frame", "graph"] | None = None,
    config: Path | None = None,
    files: SensorFiles = _FILES,
) -> None:
    """Localise a recording against a landmark database, with its gyro and without GPS.

    Args:
        recording: Folder with video, camera.yaml, and optionally rig.yaml and gyro.csv or imu.csv.
        landmarks: Database, as `vgps landmarks build` writes it.
        out: Run folder to write.
        estimator: frame estimates each pose by itself, graph (the default) the poses of the last second
            together.
        config: YAML file with settings that replace the defaults.
        files: Other calibrations or sensors.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.config import read_config
    from vgps.localization import localize
    from vgps.readers.recording import open_recording
    from vgps.runtime.timing import sequential_seconds
    from vgps.solution import FrameState
    from vgps.writers.run_folder import check_writable, write_run

    check_writable(out)
    settings = read_config(config).with_estimator(estimator)
    opened = open_recording(
        recording,
        camera=files.camera,
        rig=files.rig,
        imu=files.imu,
        with_gps=False,
        guess_camera=False,
        views=False,
    )
    solution = localize(opened, landmarks, settings, TerminalProgress())
    write_run(solution, out)
    for warning in solution.warnings:
        print_note(warning)
    frames, seconds = len(solution.t_s), sequential_seconds(solution.seconds)
    tracked = solution.state.count(FrameState.TRACKED)
    speed = f"{seconds:.1f} s ({frames / max(seconds, 1e-9):.1f} frames/s)"
    print_line(f"{tracked} of {frames} frames tracked, {speed}: {out}")

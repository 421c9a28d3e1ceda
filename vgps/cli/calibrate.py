"""The verbs ``calibrate-gyro``, ``calibrate-imu`` and ``calibrate-camera``."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from vgps.cli.app import print_line, print_note
from vgps.cli.options import CalibrationFiles, GpsSettings, RecordingFiles, SettingsOptions

_FILES, _SETTINGS = CalibrationFiles(), SettingsOptions()
_RECORDING_FILES, _GPS_SETTINGS = RecordingFiles(), GpsSettings()


def calibrate_gyro(
    recording: Path,
    *,
    out: Path,
    files: CalibrationFiles = _FILES,
    settings: SettingsOptions = _SETTINGS,
) -> None:
    """Estimate the gyro's rotation relative to the camera, its time offset and its bias from the video.

    Args:
        recording: Folder with video, camera.yaml and gyro.csv, or a GoPro video.
        out: rig.yaml to write: that of the recording, completed by the results.
        files: Other calibrations.
        settings: Settings.
    """
    from vgps.cli.tables import calibration_table
    from vgps.cli.terminal import TerminalProgress
    from vgps.gyro_calibration import calibrate_gyro as calibrate
    from vgps.readers.recording import find_rig, open_recording
    from vgps.writers.atomic import check_file

    config = settings.read()
    opened = open_recording(
        recording, camera=files.camera, rig=files.rig, with_gps=False, guess_camera=False, cameras=False
    )
    check_file(out)
    calibration = calibrate(opened, config, TerminalProgress())
    table, base = calibration_table(calibration), find_rig(recording, files.rig)
    _write(table, calibration.rig_fields(), out, base, calibration.notes)


def calibrate_imu(
    recording: Path,
    *,
    out: Path,
    imu: str | None = None,
    gps: str | None = None,
    files: CalibrationFiles = _FILES,
    settings: SettingsOptions = _SETTINGS,
) -> None:
    """Estimate the rotation of an IMU on the camera, its time offset, biases and noise from video and fixes.

    Args:
        recording: Folder with video, camera.yaml and imu.csv.
        out: rig.yaml to write: that of the recording, completed by the results.
        imu: The IMU's log, by default imu.csv; a path, or a name inside the folder.
        gps: GPS log, which shows the accelerometer's bias; a path, or a name inside the folder.
        files: Other calibrations.
        settings: Settings.
    """
    from vgps.cli.tables import calibration_table
    from vgps.cli.terminal import TerminalProgress
    from vgps.gyro_calibration.imu import calibrate_imu as calibrate
    from vgps.readers.imu import find_imu, read_imu
    from vgps.readers.recording import find_rig, open_recording
    from vgps.readers.sources import place_of
    from vgps.writers.atomic import check_file

    config, log = settings.read(), find_imu(place_of(recording)[0], imu)
    opened = open_recording(
        recording, gps=gps, camera=files.camera, rig=files.rig, guess_camera=False, cameras=False
    )
    check_file(out)
    read = read_imu(log, video_start_s=opened.rig.video_start_s)
    found = calibrate(opened, read, config, TerminalProgress())
    notes = [*read.notes, *found.notes]
    if opened.rig.imu is None or not opened.rig.imu.imu_p_camera.any():
        notes.append("imu_p_camera is not given: measure where the camera is in the IMU's frame")
    table = calibration_table(found.gyro, found.biases)
    _write(table, found.fields, out, find_rig(recording, files.rig), notes)


def _write(
    table: Table, fields: Mapping[str, Any], out: Path, base: Path | None, notes: Iterable[str]
) -> None:
    """Write rig.yaml, the base completed by the fields, and show the table and the notes."""
    from vgps.writers.rig import write_rig

    write_rig(fields, out, base=base)
    Console().print(table)
    for text in notes:
        print_note(text)
    print_line(f"wrote {out}")


def calibrate_camera(
    recording: Path,
    *,
    out: Path,
    files: RecordingFiles = _RECORDING_FILES,
    settings: GpsSettings = _GPS_SETTINGS,
) -> None:
    """Estimate the camera's calibration from its own video, beside the poses of its frames.

    Args:
        recording: A video, or a folder with one; its GPS log helps. A camera.yaml in it is refined.
        out: camera.yaml to write.
        files: Other files.
        settings: Settings.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.pipeline.offline import smooth
    from vgps.readers.recording import open_recording
    from vgps.writers.atomic import check_file
    from vgps.writers.camera import write_camera

    config = settings.read().with_refined_camera()
    opened = open_recording(recording, gps=files.gps, camera=files.camera, rig=files.rig, cameras=False)
    check_file(out)
    solution = smooth(opened, config, TerminalProgress())
    write_camera(solution, out)
    for text in solution.warnings:
        print_note(text)
    print_line(f"wrote {out}")

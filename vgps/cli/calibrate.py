"""Verbs that find out how the sensors sit on the camera."""

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from vgps.cli.app import app, note, say
from vgps.cli.terminal import TerminalProgress
from vgps.config import read_config
from vgps.gyro_calibration import GyroCalibration
from vgps.gyro_calibration import calibrate_gyro as calibrate
from vgps.readers.recording import find_rig, open_recording
from vgps.writers.atomic import check_file
from vgps.writers.rig import write_rig


@app.command
def calibrate_gyro(
    recording: Path,
    *,
    out: Path,
    config: Path | None = None,
    camera: str | None = None,
    rig: str | None = None,
    seed: int | None = None,
) -> None:
    """The gyro's rotation on the camera, the offset of its clock and its bias, from video and gyro.

    Args:
        recording: Folder with video, camera.yaml and gyro.csv, or a GoPro's video.
        out: rig.yaml to write: the recording's, with what was found.
        config: YAML that overrides the defaults.
        camera: Another camera.yaml; a path or a name inside the folder.
        rig: Another rig.yaml, a path or a name inside the folder.
        seed: Of every random choice.
    """
    settings = read_config(config).with_seed(seed)
    opened = open_recording(recording, camera=camera, rig=rig, with_gps=False)
    check_file(out)
    found = calibrate(opened, settings, TerminalProgress())
    write_rig(found.rig_fields(), out, base=find_rig(recording, rig))
    Console().print(_as_table(found))
    for words in found.notes:
        note(words)
    say(f"wrote {out}")


def _as_table(found: GyroCalibration) -> Table:
    table = Table("", "value", "standard deviation")
    for axis, row in zip("xyz", found.mount.gyro_R_camera, strict=True):
        table.add_row(f"gyro's {axis} in the camera's axes", _numbers(row, 4), "")
    table.add_row(
        "rotation about the camera's axes, deg", "", _numbers(np.degrees(found.rotation_sigma_rad), 2)
    )
    offset, sigma = 1e3 * found.mount.time_offset_s, 1e3 * found.time_offset_sigma_s
    table.add_row("offset to add to the gyro's times, ms", f"{offset:.2f}", f"{sigma:.2f}")
    bias, sigmas = np.degrees(found.mount.bias_rad_s), np.degrees(found.bias_sigma_rad_s)
    table.add_row("bias, gyro's axes, deg/s", _numbers(bias, 3), _numbers(sigmas, 3))
    table.add_section()
    table.add_row(
        f"camera's turn in {1e3 * found.interval_s:.0f} ms, deg", _numbers(np.degrees(found.turn_rad), 3), ""
    )
    table.add_row("gyro's less camera's, deg", _numbers(np.degrees(found.residual_rad), 3), "")
    table.add_row("correlation, scale", f"{found.agreement:.4f}  {found.scale:.4f}", "")
    table.add_row("intervals used, missed", f"{found.intervals}  {found.missed}", "")
    return table


def _numbers(values: np.ndarray, digits: int) -> str:
    return "  ".join(f"{value:.{digits}f}" for value in values)

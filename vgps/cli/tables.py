"""Results of verbs as tables for the terminal."""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table
from rich.text import Text

from vgps.config import LandmarksConfig, present_names

if TYPE_CHECKING:
    from vgps.gyro_calibration import GyroCalibration
    from vgps.landmarks.info import DatabaseInfo


def calibration_table(
    calibration: "GyroCalibration", biases: Mapping[str, Sequence[float]] | None = None
) -> Table:
    """Return the calibration of a gyro with standard deviations, and how well gyro and video agree.

    Args:
        calibration: From the video's rotations.
        biases: Those of an IMU as the path shows them, see :class:`vgps.solution.SensorReport`.
    """
    mount = calibration.mount
    table = Table("", "value", "standard deviation")
    for axis, row in zip("xyz", mount.gyro_R_camera, strict=True):
        table.add_row(f"gyro {axis} axis in camera axes", _numbers(row, 4), "")
    sigma = _numbers(np.degrees(calibration.rotation_sigma_rad), 2)
    table.add_row("rotation about the camera axes, deg", "", sigma)
    offset, sigma_ms = 1e3 * mount.time_offset_s, 1e3 * calibration.time_offset_sigma_s
    table.add_row("time offset, added to gyro times, ms", f"{offset:.2f}", f"{sigma_ms:.2f}")
    bias, sigmas = np.degrees(mount.bias_rad_s), np.degrees(calibration.bias_sigma_rad_s)
    table.add_row("bias in gyro axes, deg/s", _numbers(bias, 3), _numbers(sigmas, 3))
    if biases:
        by_path, sigmas = np.array(biases["accelerometer_m_s2"]), np.array(biases["accelerometer_sigma_m_s2"])
        table.add_row("accelerometer's bias, m/s^2", _numbers(by_path, 3), _numbers(sigmas, 3))
        bias, sigmas = np.degrees(biases["gyro_rad_s"]), np.degrees(biases["gyro_sigma_rad_s"])
        table.add_row("gyro's bias by the path, deg/s", _numbers(bias, 3), _numbers(sigmas, 3))
    table.add_section()
    rotation = _numbers(np.degrees(calibration.rotation_rms_rad), 3)
    table.add_row(f"camera rotation in {1e3 * calibration.interval_s:.0f} ms, rms deg", rotation, "")
    table.add_row("gyro minus camera, rms deg", _numbers(np.degrees(calibration.residual_rad), 3), "")
    table.add_row("correlation, scale", f"{calibration.agreement:.4f}  {calibration.scale:.4f}", "")
    table.add_row("intervals used, without rotation", f"{calibration.intervals}  {calibration.missed}", "")
    return table


def database_table(info: "DatabaseInfo") -> Table:
    """Return the contents of a landmark database and the runs that it was built from."""
    table = Table(show_header=False)
    for _ in range(2):
        table.add_column(overflow="fold")
    table.add_row("database", Text(str(info.path)))
    table.add_row("schema version", f"{info.schema_version}")
    table.add_row("landmarks", f"{info.landmarks}")
    table.add_row("views", f"{info.views}, {info.levels} levels of {info.patch_px} x {info.patch_px} pixels")
    table.add_row("keyframes", f"{info.keyframes} with {info.descriptors} descriptors")
    if info.world_origin is not None:
        table.add_row("origin", "{:.8f} {:.8f} deg, {:.3f} m".format(*info.world_origin))
    for axis, least, greatest in zip(("east", "north", "up"), *info.extent_m.tolist(), strict=True):
        table.add_row(axis, f"{least:.1f} to {greatest:.1f} m")
    defaults = LandmarksConfig().model_dump(mode="json")
    for source in info.sources:
        # plain JSON: another version's settings may be unknown to this one
        settings, _ = present_names(json.loads(source.settings), LandmarksConfig)
        changed = "".join(
            f", {name} {value}" for name, value in settings.items() if value != defaults.get(name)
        )
        contents = f"{source.frames} frames, {source.landmarks} landmarks{changed}"
        table.add_row(Text(f"from {source.recording}"), Text(contents))
    table.add_row("size", f"{info.file_bytes / 2**20:.1f} MB")
    table.add_row("SHA-256", info.sha256)
    return table


def _numbers(values: np.ndarray, digits: int) -> str:
    return "  ".join(f"{value:.{digits}f}" for value in values)

"""Calibration of an IMU: mounting, clock and biases against the video and its fixes, noise by the log."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vgps.config import Config
from vgps.geometry import cross_matrices
from vgps.gyro_calibration.calibrate import GyroCalibration, calibrate_gyro
from vgps.imu.camera_imu import noise_densities
from vgps.model import GyroLog, ImuLog, ImuMount, Recording, Rig
from vgps.pipeline.offline import smooth
from vgps.readers.imu import on_video_clock
from vgps.runtime.progress import Progress

_NAMES = {
    "gyro_R_camera": "imu_R_camera",
    "gyro_rotation_sigma_deg": "imu_rotation_sigma_deg",
    "gyro_time_offset_s": "imu_time_offset_s",
    "gyro_time_offset_sigma_s": "imu_time_offset_sigma_s",
    "gyro_bias_rad_s": "imu_gyro_bias_rad_s",
    "gyro_bias_sigma_rad_s": "imu_gyro_bias_sigma_rad_s",
}
_UNITS = {"accelerometer": "m_s2", "gyro": "rad_s"}


@dataclass(frozen=True, kw_only=True)
class ImuCalibration:
    """Calibration of an IMU.

    Attributes:
        gyro: Rotation, clock offset and gyro bias, as rotations of the video show them.
        biases: Both biases by the path, as in :class:`vgps.solution.SensorReport`; empty without fixes.
        fields: Keys for rig.yaml, without those that the motion does not show.
        notes: What to know before using the result.
    """

    gyro: GyroCalibration
    biases: Mapping[str, list[float]]
    fields: Mapping[str, Any]
    notes: tuple[str, ...]


def calibrate_imu(
    recording: Recording, log: ImuLog, config: Config | None = None, progress: Progress | None = None
) -> ImuCalibration:
    """Estimate rotation, clock offset, biases and noise of an IMU.

    The video's rotations show the mounting, the clock and the gyro's bias. The accelerometer's bias is its
    specific force minus that of the smoothed path: it takes fixes or control points, and a camera that
    turns, since a bias and a tilt look alike. The lever arm has to be measured.

    Args:
        recording: Video, camera, fixes; its own gyro and mounting are ignored.
        log: The IMU's log on the clock of the recording, without the rig's time offset.
        config, progress: As for :func:`vgps.smooth`.

    Raises:
        GyroLogError, GeometryError: As :func:`vgps.gyro_calibration.calibrate_gyro`.
    """
    config = config or Config()
    rig = replace(recording.rig, gyro_time_offset_s=0.0, gyro_bias_rad_s=np.zeros(3))
    gyro = GyroLog(log.t_s, log.rate_rad_s, log.source)
    by_video = calibrate_gyro(replace(recording, gyro=gyro, rig=rig), config, progress)
    found = by_video.rig_fields()
    fields = {name: found[key] for key, name in _NAMES.items() if key in found}
    densities = zip(("imu_gyro_density", "imu_accelerometer_density"), noise_densities(log), strict=True)
    fields |= {name: float(f"{density:.3g}") for name, density in densities if density > 0.0}
    biases, notes = _path_biases(recording, log, by_video, config, progress)
    for name, unit in _UNITS.items() if biases else ():
        fields[f"imu_{name}_bias_{unit}"] = np.round(biases[f"{name}_{unit}"], 6).tolist()
        fields[f"imu_{name}_bias_sigma_{unit}"] = np.round(biases[f"{name}_sigma_{unit}"], 6).tolist()
    return ImuCalibration(gyro=by_video, biases=biases, fields=fields, notes=(*by_video.notes, *notes))


def _path_biases(
    recording: Recording, log: ImuLog, found: GyroCalibration, config: Config, progress: Progress | None
) -> tuple[Mapping[str, list[float]], tuple[str, ...]]:
    """Return both biases by the smoothed path, empty if it does not show them, and notes."""
    missing = "the accelerometer's bias is not known"
    if recording.gps is None and recording.control_points is None:
        return {}, (f"{missing}: it takes fixes (--gps) to separate it from gravity and accelerations",)
    rig = _mounted(recording.rig, found)
    mounted = replace(recording, rig=rig, imu=on_video_clock(log, rig), gyro=None)
    solution = smooth(mounted, config, progress)
    biases = solution.sensors.imu
    if "accelerometer_sigma_m_s2" not in biases:
        return {}, (f"{missing}: the path could not be compared with it", *solution.warnings)
    biases = {**biases, "accelerometer_sigma_m_s2": _with_mounting(biases, found, log)}
    sigma, prior = max(biases["accelerometer_sigma_m_s2"]), config.imu.accelerometer_bias_sigma
    if sigma > config.sensors.time_offset.shown_share * prior:
        return biases, (f"the accelerometer's bias is only known to {sigma:.2f} m/s^2: tilt the camera more",)
    return biases, ()


def _with_mounting(biases: Mapping[str, list[float]], found: GyroCalibration, log: ImuLog) -> list[float]:
    """Return the accelerometer's standard deviations with those of the mounting, which turns gravity."""
    R = found.mount.gyro_R_camera
    turned = R @ cross_matrices(R.T @ log.force_m_s2.mean(axis=0)) * found.rotation_sigma_rad
    by_path = np.array(biases["accelerometer_sigma_m_s2"])
    return [float(sigma) for sigma in np.hypot(by_path, np.linalg.norm(turned, axis=1))]


def _mounted(rig: Rig, found: GyroCalibration) -> Rig:
    """Return the rig with the mounting and the clock that the video shows."""
    arm = np.zeros(3) if rig.imu is None else rig.imu.imu_p_camera
    mount = ImuMount(imu_R_camera=found.mount.gyro_R_camera, imu_p_camera=arm)
    if found.bias_known:
        mount = replace(mount, gyro_bias_rad_s=found.mount.bias_rad_s)
    offset_s = found.mount.time_offset_s if found.offset_known else 0.0
    return replace(rig, imu=mount, imu_time_offset_s=offset_s)

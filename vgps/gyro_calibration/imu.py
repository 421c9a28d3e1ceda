"""Calibration of an IMU's mounting and clock by its gyro, and of its noise by the log."""

from dataclasses import replace
from typing import Any

import numpy as np

from vgps.config import Config
from vgps.gyro_calibration.calibrate import GyroCalibration, calibrate_gyro
from vgps.imu.camera_imu import noise_densities
from vgps.model import GyroLog, ImuLog, Recording
from vgps.runtime.progress import Progress


def calibrate_imu(
    recording: Recording, log: ImuLog, config: Config | None = None, progress: Progress | None = None
) -> tuple[GyroCalibration, dict[str, Any]]:
    """Estimate rotation, clock offset and gyro bias of an IMU from the video, and its noise.

    The lever arm has to be measured; the accelerometer's bias is estimated with the path by ``vgps smooth``.

    Args:
        recording: Video and camera; its own gyro and mounting are ignored.
        log: The IMU's log on the clock of the recording, without the rig's time offset.
        config, progress: As for :func:`calibrate_gyro`.

    Returns:
        The calibration, and the keys for rig.yaml without those that the motion does not show.

    Raises:
        GyroLogError, GeometryError: As :func:`calibrate_gyro`.
    """
    rig = replace(recording.rig, gyro_time_offset_s=0.0, gyro_bias_rad_s=np.zeros(3))
    gyro = GyroLog(log.t_s, log.rate_rad_s, log.source)
    calibration = calibrate_gyro(replace(recording, gyro=gyro, rig=rig), config, progress)
    names = {
        "gyro_R_camera": "imu_R_camera",
        "gyro_time_offset_s": "imu_time_offset_s",
        "gyro_bias_rad_s": "imu_gyro_bias_rad_s",
    }
    found = calibration.rig_fields()
    fields = {name: found[key] for key, name in names.items() if key in found}
    densities = zip(("imu_gyro_density", "imu_accelerometer_density"), noise_densities(log), strict=True)
    return calibration, fields | {
        name: float(f"{density:.3g}") for name, density in densities if density > 0.0
    }

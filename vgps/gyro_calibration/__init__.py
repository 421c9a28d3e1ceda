"""Calibration of a gyro on a camera: rotation, clock offset and bias, from a video and the gyro's rates."""

from vgps.gyro_calibration.calibrate import GyroCalibration, calibrate_from_rotations, calibrate_gyro
from vgps.imu.mount_fit import Mount

__all__ = ["GyroCalibration", "Mount", "calibrate_from_rotations", "calibrate_gyro"]

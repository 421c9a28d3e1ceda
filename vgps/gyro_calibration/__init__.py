"""A gyro's rotation on the camera, the offset of its clock and its bias, from a video and its rates."""

from vgps.gyro_calibration.calibrate import GyroCalibration, calibrate_from_turns, calibrate_gyro
from vgps.gyro_calibration.fit import Mount

__all__ = ["GyroCalibration", "Mount", "calibrate_from_turns", "calibrate_gyro"]

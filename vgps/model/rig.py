"""The rig: how antenna, IMU and other cameras are mounted on the camera, and how their clocks relate."""

from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from vgps.model.arrays import FloatArray
from vgps.model.camera import Camera
from vgps.model.gps import GeodeticPoint
from vgps.model.video import Masks, Video


@dataclass(frozen=True, kw_only=True)
class ImuMount:
    """Mounting of an IMU on the camera, and what a calibration found of its errors.

    Attributes:
        imu_R_camera: (3, 3) rotation from camera to IMU axes.
        imu_p_camera: (3,) camera in the IMU's frame, metres.
        gyro_bias_rad_s, accelerometer_bias_m_s2: (3,) expected biases in the IMU's axes, zero if unknown.
        gyro_density: White noise of the rates, rad/s/sqrt(Hz); None to estimate it from the log.
        accelerometer_density: White noise of the specific force, m/s^2/sqrt(Hz); None likewise.
    """

    imu_R_camera: FloatArray
    imu_p_camera: FloatArray = field(default_factory=lambda: np.zeros(3))
    gyro_bias_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    accelerometer_bias_m_s2: FloatArray = field(default_factory=lambda: np.zeros(3))
    gyro_density: float | None = None
    accelerometer_density: float | None = None


@dataclass(frozen=True, kw_only=True)
class Rig:
    """Mounting of the sensors on the camera, and relation of their clocks.

    Attributes:
        camera_p_antenna: Antenna (phase centre) in the camera frame, (3,), metres.
        antenna_known: Whether ``camera_p_antenna`` was measured; else it is a guess, as for a camera's own
            receiver.
        video_start_utc: UTC instant of the video's first frame; None if the log is on the video's clock.
        world_origin: Origin of the ENU world frame; None for the first usable fix.
        gyro_R_camera: (3, 3) rotation from camera to gyro axes.
        gyro_time_offset_s: Delay of the gyro's clock, which the reader adds to its times.
        gyro_bias_rad_s: (3,) subtracted from the gyro's rates by the reader.
        imu: Mounting of the IMU; None if it is not known.
        imu_time_offset_s: Delay of the IMU's clock, which the reader adds to its times.
        exposure_s: Exposure time of a frame.
        video_start_s: Time of the first frame on the clock of ``gyro.csv``, ``imu.csv`` and ``truth.tum``.
    """

    camera_p_antenna: FloatArray = field(default_factory=lambda: np.zeros(3))
    antenna_known: bool = True
    video_start_utc: datetime | None = None
    world_origin: GeodeticPoint | None = None
    gyro_R_camera: FloatArray | None = None
    gyro_time_offset_s: float = 0.0
    gyro_bias_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    imu: ImuMount | None = None
    imu_time_offset_s: float = 0.0
    exposure_s: float | None = None
    video_start_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class RigCamera:
    """Another camera of a rig, fixed to the reference camera, whose poses a run estimates.

    Attributes:
        name: Its name in ``rig.yaml``.
        video: Its video, on the clock of the reference camera's.
        camera: Its calibration.
        reference_T_camera: (4, 4) its pose on the rig.
        sigma: (6,) its standard deviations about its own axes [rotation rad; translation m]; 0 holds it.
        masks: Where its pictures show the scene.
    """

    name: str
    video: Video
    camera: Camera
    reference_T_camera: FloatArray
    sigma: FloatArray
    masks: Masks | None = None

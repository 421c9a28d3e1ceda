"""``rig.yaml``: where antenna, gyro, IMU and other cameras are, and when the video began.

All fields are optional: ``camera_p_antenna`` [m], ``video_start_utc``, ``world_origin`` (latitude, longitude
[deg], ellipsoidal height [m]), ``gyro_R_camera`` (three rows), ``gyro_time_offset_s``, ``gyro_bias_rad_s``,
``exposure_s``, ``video_start_s``. Of an IMU: ``imu_R_camera`` (three rows), ``imu_p_camera`` (the camera in
the IMU's frame) [m], ``imu_time_offset_s``, ``imu_gyro_bias_rad_s``, ``imu_accelerometer_bias_m_s2``,
``imu_gyro_density`` [rad/s/sqrt(Hz)], ``imu_accelerometer_density`` [m/s^2/sqrt(Hz)]. For information only,
a calibration's standard deviations: ``gyro_rotation_sigma_deg``, ``gyro_bias_sigma_rad_s`` and so on.

Of a rig of several cameras: ``cameras``, a list of those beside the recording's own, the reference. Each has

- ``name``, and ``video``, a file or a folder of images beside rig.yaml;
- ``camera``: its calibration, unless it is that of the reference;
- ``reference_R_camera`` (three rows) and ``reference_p_camera`` (its centre in the reference camera's frame)
  [m], and their standard deviations on each axis ``rotation_sigma_deg`` (0.5) and ``position_sigma_m``
  (0.01); 0 holds them as they are given;
- ``time_offset_s``: the time of its first frame on the clock of the reference's video.
"""

import logging
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, FiniteFloat

from vgps.errors import CalibrationError
from vgps.model import FloatArray, GeodeticPoint, ImuMount, Rig
from vgps.readers.calibration.yaml_fields import (
    Fields,
    NotNegative,
    Positive,
    Rotation,
    Vector3,
    read_fields,
    rotation_of,
)

log = logging.getLogger(__name__)
_FAR_M = 5.0  # of an antenna that may be given in millimetres or centimetres


def _folder_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,40}", name):
        raise ValueError("1 to 40 letters, digits, - and _")
    return name


Latitude = Annotated[FiniteFloat, Field(ge=-90, le=90)]
Longitude = Annotated[FiniteFloat, Field(ge=-180, le=180)]


class CameraFields(Fields):
    """Another camera of the rig."""

    name: Annotated[str, AfterValidator(_folder_name)]
    video: Path
    camera: Path | None = None
    reference_R_camera: Rotation
    reference_p_camera: Vector3 = (0.0, 0.0, 0.0)
    rotation_sigma_deg: NotNegative = 0.5
    position_sigma_m: NotNegative = 0.01
    time_offset_s: FiniteFloat = 0.0

    def reference_T_camera(self, path: Path) -> FloatArray:
        """Return the pose (4, 4) on the reference camera.

        Raises:
            CalibrationError: It is no rotation.
        """
        pose = np.eye(4)
        place = f"key reference_R_camera of camera {self.name}"
        pose[:3, :3] = rotation_of(self.reference_R_camera, path, place)
        pose[:3, 3] = self.reference_p_camera
        return pose

    @property
    def sigma(self) -> FloatArray:
        """(6,) standard deviations of the pose about its own axes [rotation rad; translation m]."""
        return np.repeat([np.radians(self.rotation_sigma_deg), self.position_sigma_m], 3)


class RigFields(Fields):
    """All fields."""

    camera_p_antenna: Vector3 | None = None
    video_start_utc: datetime | None = None
    world_origin: tuple[Latitude, Longitude, FiniteFloat] | None = None
    gyro_R_camera: Rotation | None = None
    gyro_time_offset_s: FiniteFloat = 0.0
    gyro_bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
    gyro_rotation_sigma_deg: Vector3 | None = None
    gyro_time_offset_sigma_s: FiniteFloat | None = None
    gyro_bias_sigma_rad_s: Vector3 | None = None
    imu_R_camera: Rotation | None = None
    imu_p_camera: Vector3 = (0.0, 0.0, 0.0)
    imu_time_offset_s: FiniteFloat = 0.0
    imu_gyro_bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
    imu_accelerometer_bias_m_s2: Vector3 = (0.0, 0.0, 0.0)
    imu_gyro_density: Positive | None = None
    imu_accelerometer_density: Positive | None = None
    imu_rotation_sigma_deg: Vector3 | None = None
    imu_time_offset_sigma_s: FiniteFloat | None = None
    imu_gyro_bias_sigma_rad_s: Vector3 | None = None
    imu_accelerometer_bias_sigma_m_s2: Vector3 | None = None
    exposure_s: NotNegative | None = None
    video_start_s: FiniteFloat = 0.0
    cameras: tuple[CameraFields, ...] = ()


def read_rig(path: str | Path) -> Rig:
    """Read ``rig.yaml``; a naive ``video_start_utc`` is UTC.

    Raises:
        CalibrationError: The file is missing or not YAML, a field is unknown or impossible, or a matrix
            ``..._R_camera`` is not a rotation.
    """
    path = Path(path)
    fields = read_fields(RigFields, path)
    gyro, antenna = fields.gyro_R_camera, np.array(fields.camera_p_antenna or (0.0, 0.0, 0.0))
    if (distance_m := float(np.linalg.norm(antenna))) > _FAR_M:
        log.warning(
            "%s: the antenna is %g m from the camera: camera_p_antenna is in metres", path, distance_m
        )
    return Rig(
        camera_p_antenna=antenna,
        antenna_known=fields.camera_p_antenna is not None,
        video_start_utc=_utc(fields.video_start_utc, path),
        world_origin=GeodeticPoint(*fields.world_origin) if fields.world_origin else None,
        gyro_R_camera=None if gyro is None else rotation_of(gyro, path, "key gyro_R_camera"),
        gyro_time_offset_s=fields.gyro_time_offset_s,
        gyro_bias_rad_s=np.array(fields.gyro_bias_rad_s),
        imu=_imu_mount(fields, path),
        imu_time_offset_s=fields.imu_time_offset_s,
        exposure_s=fields.exposure_s,
        video_start_s=fields.video_start_s,
    )


def _imu_mount(fields: RigFields, path: Path) -> ImuMount | None:
    if fields.imu_R_camera is None:
        return None
    return ImuMount(
        imu_R_camera=rotation_of(fields.imu_R_camera, path, "key imu_R_camera"),
        imu_p_camera=np.array(fields.imu_p_camera),
        gyro_bias_rad_s=np.array(fields.imu_gyro_bias_rad_s),
        accelerometer_bias_m_s2=np.array(fields.imu_accelerometer_bias_m_s2),
        gyro_density=fields.imu_gyro_density,
        accelerometer_density=fields.imu_accelerometer_density,
    )


def rig_beside(file: str | Path) -> Rig:
    """Read the ``rig.yaml`` beside a truth, with its origin and clock; an empty rig if there is none.

    Raises:
        CalibrationError: As `read_rig`.
    """
    rig = Path(file).parent / "rig.yaml"
    return read_rig(rig) if rig.is_file() else Rig()


def _utc(instant: datetime | None, path: Path) -> datetime | None:
    if instant is None or instant.tzinfo is None:
        return instant and instant.replace(tzinfo=UTC)
    try:
        return instant.astimezone(UTC)
    except OverflowError:
        raise CalibrationError(
            str(instant), file=path, place="key video_start_utc", expected="UTC in the years 1 to 9999"
        ) from None

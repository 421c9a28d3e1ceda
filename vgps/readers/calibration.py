"""``camera.yaml`` and ``rig.yaml``; ``calibration_formats.py`` reads other programs' calibrations.

camera.yaml: ``model`` (pinhole, opencv, fisheye, tsai), ``width``, ``height``, ``fx``, ``fy``, ``cx``, ``cy``
in pixels, ``distortion`` (opencv: k1, k2, p1, p2[, k3[, k4, k5, k6]]; fisheye: k1..k4; tsai: kappa1 [mm^-2],
kappa2 [mm^-4]) and, for tsai, ``pixel_mm: [width, height]``. A tsai camera may instead give the parameters of
Table 2, Kume 2010: ``focal_mm``, ``ccd_mm: [width, height]``, ``scale`` (s_x), ``cx``, ``cy`` and
``kappa: [kappa1, kappa2]``. ``readout_s`` (optional) is the time from the first row to the last of a rolling
shutter, 0 for a global one, negative if the last row is read first.

``rig_fields.py`` lists the fields of rig.yaml.
"""

import logging
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import FiniteFloat

from vgps.errors import CalibrationError
from vgps.model import Camera, GeodeticPoint, ImuMount, Rig, Video
from vgps.readers.calibration_formats import camera_from_kalibr, camera_from_text
from vgps.readers.rig_fields import RigFields
from vgps.readers.table import read_bytes
from vgps.readers.yaml_fields import (
    Fields,
    Pixels,
    Positive,
    Readout,
    mapping_of,
    read_fields,
    rotation_of,
    validated,
)

log = logging.getLogger(__name__)
_COEFFICIENTS = {"pinhole": {0}, "opencv": {4, 5, 8}, "fisheye": {4}, "tsai": {2}}
_FAR_M = 5.0  # of an antenna that may be given in millimetres or centimetres


class _CameraFields(Fields):
    model: Literal["pinhole", "opencv", "fisheye", "tsai"]
    width: Pixels
    height: Pixels
    fx: Positive
    fy: Positive
    cx: FiniteFloat
    cy: FiniteFloat
    distortion: tuple[FiniteFloat, ...] = ()
    pixel_mm: tuple[Positive, Positive] | None = None
    readout_s: Readout | None = None
    readout_axis: Literal["rows", "columns"] = "rows"

    def camera(self) -> Camera:
        return Camera(**self.model_dump())


class _TsaiFields(Fields):
    model: Literal["tsai"]
    width: Pixels
    height: Pixels
    focal_mm: Positive
    ccd_mm: tuple[Positive, Positive]
    scale: Positive = 1.0
    cx: FiniteFloat
    cy: FiniteFloat
    kappa: tuple[FiniteFloat, FiniteFloat]
    readout_s: Readout | None = None

    def camera(self) -> Camera:
        """Return the camera, Eq. (4) and (6), Kume 2010: pixels are ccd_x / (scr_x s_x) by ccd_y / scr_y."""
        pixel = (self.ccd_mm[0] / self.width / self.scale, self.ccd_mm[1] / self.height)
        fx, fy = self.focal_mm / pixel[0], self.focal_mm / pixel[1]
        return Camera(
            model="tsai",
            width=self.width,
            height=self.height,
            fx=fx,
            fy=fy,
            cx=self.cx,
            cy=self.cy,
            distortion=self.kappa,
            pixel_mm=pixel,
            readout_s=self.readout_s,
        )


def read_camera(path: str | Path) -> Camera:
    """Read ``camera.yaml``, OpenCV's FileStorage, Kalibr's ``camchain.yaml`` or COLMAP's ``cameras.txt``.

    The content tells which. COLMAP's principal point is shifted by half a pixel to the pixels used here.

    Raises:
        CalibrationError: The file is missing or of no known format, a field is missing, unknown or
            impossible, the number of coefficients does not fit the lens model, or there are several cameras.
    """
    path = Path(path)
    content = camera_from_text(read_bytes(path, CalibrationError), path)
    if content is None:
        content = mapping_of(path)
        content = camera_from_kalibr(content, path) or content
    if "focal_mm" in content:
        return validated(_TsaiFields, content, path).camera()
    camera = validated(_CameraFields, content, path).camera()
    counts = _COEFFICIENTS[camera.model]
    if len(camera.distortion) not in counts:
        raise CalibrationError(
            f"{len(camera.distortion)} coefficients",
            file=path,
            place="key distortion",
            expected=f"{' or '.join(map(str, sorted(counts)))} for model {camera.model}",
        )
    if (camera.model == "tsai") != (camera.pixel_mm is not None):
        raise CalibrationError(
            "missing" if camera.model == "tsai" else f"given for model {camera.model}",
            file=path,
            place="key pixel_mm",
            expected="the size of a pixel on the sensor, for model tsai only",
        )
    return camera


def read_camera_of(video: Video, path: Path) -> Camera:
    """Read the calibration of a video as :func:`read_camera` does.

    Raises:
        CalibrationError: Likewise; or it is of another size than the video.
    """
    camera = read_camera(path)
    if (camera.width, camera.height) != (video.width, video.height):
        raise CalibrationError(
            f"a camera of {camera.width} x {camera.height}",
            file=path,
            expected=f"{video.width} x {video.height} as in {video.path}",
            remedy="calibrate the camera at the video's size",
        )
    return camera


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

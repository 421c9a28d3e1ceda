"""``camera.yaml`` and ``rig.yaml``; ``calibration_formats.py`` reads other programs' calibrations.

camera.yaml: ``model`` (pinhole, opencv, fisheye, tsai), ``width``, ``height``, ``fx``, ``fy``, ``cx``, ``cy``
in pixels, ``distortion`` (opencv: k1, k2, p1, p2[, k3[, k4, k5, k6]]; fisheye: k1..k4; tsai: kappa1 [mm^-2],
kappa2 [mm^-4]) and, for tsai, ``pixel_mm: [width, height]``. A tsai camera may instead give the parameters of
Table 2, Kume 2010: ``focal_mm``, ``ccd_mm: [width, height]``, ``scale`` (s_x), ``cx``, ``cy`` and
``kappa: [kappa1, kappa2]``. ``readout_s`` (optional) is the time from the first row to the last of a rolling
shutter, 0 for a global one, negative if the last row is read first.

rig.yaml (all optional): ``camera_p_antenna`` [m], ``video_start_utc``, ``world_origin`` (latitude, longitude
[deg], ellipsoidal height [m]), ``gyro_R_camera`` (three rows), ``gyro_time_offset_s``, ``gyro_bias_rad_s``,
``exposure_s``, ``video_start_s``. Of an IMU: ``imu_R_camera`` (three rows), ``imu_p_camera`` (the camera in
the IMU's frame) [m], ``imu_time_offset_s``, ``imu_gyro_bias_rad_s``, ``imu_accelerometer_bias_m_s2``,
``imu_gyro_density`` [rad/s/sqrt(Hz)], ``imu_accelerometer_density`` [m/s^2/sqrt(Hz)]. For information only,
a calibration's standard deviations: ``gyro_rotation_sigma_deg``, ``gyro_bias_sigma_rad_s`` and so on.
"""

import logging
from datetime import UTC, datetime
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from vgps.config.yaml_text import YamlTextError, parse_yaml
from vgps.errors import CalibrationError
from vgps.model import Camera, FloatArray, GeodeticPoint, ImuMount, Rig
from vgps.readers.calibration_formats import camera_from_kalibr, camera_from_text
from vgps.readers.table import read_bytes

log = logging.getLogger(__name__)
Positive = Annotated[FiniteFloat, Field(gt=0)]
Readout = Annotated[FiniteFloat, Field(ge=-1.0, le=1.0)]
Pixels = Annotated[int, Field(gt=0, le=1_000_000)]
Vector3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Latitude = Annotated[FiniteFloat, Field(ge=-90, le=90)]
Longitude = Annotated[FiniteFloat, Field(ge=-180, le=180)]
_COEFFICIENTS = {"pinhole": {0}, "opencv": {4, 5, 8}, "fisheye": {4}, "tsai": {2}}
_FAR_M = 5.0  # of an antenna that may be given in millimetres or centimetres
_ORTHOGONAL = 1e-3  # tolerance for the rounding of a printed rotation


class _Fields(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _CameraFields(_Fields):
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


class _TsaiFields(_Fields):
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


class _RigFields(_Fields):
    camera_p_antenna: Vector3 | None = None
    video_start_utc: datetime | None = None
    world_origin: tuple[Latitude, Longitude, FiniteFloat] | None = None
    gyro_R_camera: tuple[Vector3, Vector3, Vector3] | None = None
    gyro_time_offset_s: FiniteFloat = 0.0
    gyro_bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
    gyro_rotation_sigma_deg: Vector3 | None = None
    gyro_time_offset_sigma_s: FiniteFloat | None = None
    gyro_bias_sigma_rad_s: Vector3 | None = None
    imu_R_camera: tuple[Vector3, Vector3, Vector3] | None = None
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
    exposure_s: Annotated[FiniteFloat, Field(ge=0)] | None = None
    video_start_s: FiniteFloat = 0.0


F = TypeVar("F", bound=_Fields)


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
        content = _mapping(path)
        content = camera_from_kalibr(content, path) or content
    if "focal_mm" in content:
        return _validated(_TsaiFields, content, path).camera()
    camera = _validated(_CameraFields, content, path).camera()
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


def read_rig(path: str | Path) -> Rig:
    """Read ``rig.yaml``; a naive ``video_start_utc`` is UTC.

    Raises:
        CalibrationError: The file is missing or not YAML, a field is unknown or impossible, or
            ``gyro_R_camera`` or ``imu_R_camera`` is not a rotation.
    """
    path = Path(path)
    fields = _validated(_RigFields, _mapping(path, may_be_empty=True), path)
    antenna = np.array(fields.camera_p_antenna or (0.0, 0.0, 0.0))
    if (distance_m := float(np.linalg.norm(antenna))) > _FAR_M:
        log.warning(
            "%s: the antenna is %g m from the camera: camera_p_antenna is in metres", path, distance_m
        )
    return Rig(
        camera_p_antenna=antenna,
        antenna_known=fields.camera_p_antenna is not None,
        video_start_utc=_utc(fields.video_start_utc, path),
        world_origin=GeodeticPoint(*fields.world_origin) if fields.world_origin else None,
        gyro_R_camera=_rotation(fields, "gyro_R_camera", path) if fields.gyro_R_camera else None,
        gyro_time_offset_s=fields.gyro_time_offset_s,
        gyro_bias_rad_s=np.array(fields.gyro_bias_rad_s),
        imu=_imu_mount(fields, path),
        imu_time_offset_s=fields.imu_time_offset_s,
        exposure_s=fields.exposure_s,
        video_start_s=fields.video_start_s,
    )


def _imu_mount(fields: _RigFields, path: Path) -> ImuMount | None:
    if fields.imu_R_camera is None:
        return None
    return ImuMount(
        imu_R_camera=_rotation(fields, "imu_R_camera", path),
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


def _mapping(path: Path, *, may_be_empty: bool = False) -> dict[str, Any]:
    try:
        content = parse_yaml(read_bytes(path, CalibrationError))
    except YamlTextError as error:
        raise CalibrationError(
            f"not YAML ({error.problem})",
            file=path,
            place=f"line {error.line}" if error.line else None,
            expected="text with lines of the form 'key: value'",
        ) from error
    if content is None and may_be_empty:
        return {}
    if not isinstance(content, dict):
        raise CalibrationError("no fields", file=path, expected="lines of the form 'key: value'")
    return {str(key): value for key, value in content.items()}


def _validated(fields: type[F], content: dict[str, Any], path: Path) -> F:
    try:
        return fields.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        known = list(fields.model_fields)
        place = f"key {key}"
        if first["type"] == "missing":
            raise CalibrationError("missing", file=path, place=place, remedy=f"add {key}") from None
        if first["type"] == "extra_forbidden":
            close = get_close_matches(key, known, 1, 0.6)
            remedy = f"did you mean {close[0]}?" if close else f"known keys: {', '.join(known)}"
            raise CalibrationError("unknown key", file=path, place=place, remedy=remedy) from None
        expected = first["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        raise CalibrationError(f"{first['input']!r}", file=path, place=place, expected=expected) from None


def _utc(instant: datetime | None, path: Path) -> datetime | None:
    if instant is None or instant.tzinfo is None:
        return instant and instant.replace(tzinfo=UTC)
    try:
        return instant.astimezone(UTC)
    except OverflowError:
        raise CalibrationError(
            str(instant), file=path, place="key video_start_utc", expected="UTC in the years 1 to 9999"
        ) from None


def _rotation(fields: _RigFields, key: str, path: Path) -> FloatArray:
    """Return the rotation nearest to a printed matrix."""
    matrix = np.array(getattr(fields, key))
    # entries beyond 2 are far from a rotation, and their squares may overflow
    off = float(np.abs(matrix @ matrix.T - np.eye(3)).max()) if np.abs(matrix).max() <= 2 else np.inf
    if off > _ORTHOGONAL or np.linalg.det(matrix) < 0:
        found = "a reflection" if off <= _ORTHOGONAL else f"R R^T differs from the identity by {off:.2g}"
        raise CalibrationError(found, file=path, place=f"key {key}", expected="a rotation matrix")
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ vt, np.float64)

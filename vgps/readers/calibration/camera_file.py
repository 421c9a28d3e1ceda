"""``camera.yaml``; ``other_programs.py`` reads other programs' calibrations.

Its fields: ``model`` (pinhole, opencv, fisheye, tsai), ``width``, ``height``, ``fx``, ``fy``, ``cx``, ``cy``
in pixels, ``distortion`` (opencv: k1, k2, p1, p2[, k3[, k4, k5, k6]]; fisheye: k1..k4; tsai: kappa1 [mm^-2],
kappa2 [mm^-4]) and, for tsai, ``pixel_mm: [width, height]``. A tsai camera may instead give the parameters of
Table 2, Kume 2010: ``focal_mm``, ``ccd_mm: [width, height]``, ``scale`` (s_x), ``cx``, ``cy`` and
``kappa: [kappa1, kappa2]``. ``readout_s`` (optional) is the time from the first row to the last of a rolling
shutter, 0 for a global one, negative if the last row is read first. ``model: equirectangular`` (``width`` and
``height``) is read by ``views/wide_pictures.py``: no single camera sees it.
"""

from pathlib import Path
from typing import Literal

from pydantic import FiniteFloat

from vgps.errors import CalibrationError
from vgps.model import Camera, Video
from vgps.readers.calibration.other_programs import camera_from_kalibr, camera_from_text
from vgps.readers.calibration.yaml_fields import (
    Fields,
    Pixels,
    Positive,
    Readout,
    mapping_of,
    validated,
)
from vgps.readers.table import read_bytes

_COEFFICIENTS = {"pinhole": {0}, "opencv": {4, 5, 8}, "fisheye": {4}, "tsai": {2}}


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

    Formats are recognised by content. COLMAP's principal point is shifted by half a pixel.

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

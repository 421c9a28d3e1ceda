"""A camera: its intrinsics, and what is assumed of them without a calibration."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from vgps.model.arrays import FloatArray

LensModel = Literal["pinhole", "opencv", "fisheye", "tsai"]


@dataclass(frozen=True)
class FocalChanges:
    """Changes of the focal length in a video, as by focus or zoom, at times (K,), linear between them.

    Attributes:
        t_s: The times, ascending, seconds since the first frame.
        log_ratio: Log of the focal length over that of the camera.
        centre_px: The point of the picture about which it grows and shrinks.
    """

    t_s: tuple[float, ...]
    log_ratio: tuple[float, ...]
    centre_px: tuple[float, float]

    def ratio(self, t_s: FloatArray | float) -> FloatArray:
        """Return the focal length at times (F,), over that of the camera."""
        return np.asarray(np.exp(np.interp(t_s, self.t_s, self.log_ratio)))

    def followed_by(self, more: "FocalChanges") -> "FocalChanges":
        """Return the changes together with those that pictures without the first ones still show."""
        t_s = np.union1d(self.t_s, more.t_s)
        both = np.log(self.ratio(t_s) * more.ratio(t_s))
        return FocalChanges(tuple(t_s.tolist()), tuple(both.tolist()), self.centre_px)


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Intrinsics: focal lengths and principal point in pixels, and the lens model's coefficients.

    ``distortion``: ``opencv`` (k1, k2, p1, p2[, k3]); ``fisheye`` (k1..k4); ``tsai`` (kappa1 [mm^-2],
    kappa2 [mm^-4]) with ``pixel_mm`` (width, height of a pixel on the sensor, the width already divided by
    the scale factor s_x, Eq. (6), Kume 2010); ``pinhole`` none.

    ``readout_s``: time from the exposure of the first row to that of the last, 0 for a global shutter,
    negative if the last row comes first, None if unknown. A frame's time stamp and pose are those of its
    middle row. With ``readout_axis`` ``columns``, as of a picture turned upright by a quarter, it is from the
    left column to the right one.

    With ``focal_changes`` all else holds for pictures that were scaled to one focal length
    (:class:`vgps.readers.views.steady.SteadyVideo`).
    """

    model: LensModel
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    pixel_mm: tuple[float, float] | None = None
    readout_s: float | None = None
    readout_axis: Literal["rows", "columns"] = "rows"
    focal_changes: FocalChanges | None = None

    @property
    def K(self) -> FloatArray:
        """The (3, 3) calibration matrix of the undistorted (pinhole) image."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, kw_only=True)
class CameraGuess:
    """What is assumed of a camera that comes without a calibration.

    Attributes:
        camera: Mean of the assumption, of model ``opencv`` or ``fisheye``.
        focal_sigma: Standard deviation of the focal length, as a share of it.
        centre_sigma_px: Of the principal point, on each axis.
        distortion_sigma: Of the first two radial coefficients.
        source: Where it comes from, as a sentence without a full stop.
    """

    camera: Camera
    focal_sigma: float
    centre_sigma_px: float
    distortion_sigma: tuple[float, float]
    source: str

    @property
    def sigmas(self) -> FloatArray:
        """(5,) standard deviations of log focal length, principal point [px] and radial coefficients."""
        return np.array([self.focal_sigma, *[self.centre_sigma_px] * 2, *self.distortion_sigma])

"""Data exchanged between packages: frozen dataclasses of NumPy arrays, with units in their names.

Frames: ``world`` is local ENU at ``world_origin``; ``camera`` is OpenCV's (x right, y down, z forward);
``world_T_camera`` maps camera coordinates to world coordinates. Times are seconds since the video's first
frame.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
GrayImage = npt.NDArray[np.uint8]
RgbImage = npt.NDArray[np.uint8]

LensModel = Literal["pinhole", "opencv", "fisheye", "tsai"]


class FixClass(StrEnum):
    """How a GPS fix was obtained, best first; the class determines the size of its region."""

    RTK_FIX = "rtk_fix"
    RTK_FLOAT = "rtk_float"
    PPP = "ppp"
    DGPS = "dgps"
    SBAS = "sbas"
    SINGLE = "single"
    UNKNOWN = "unknown"


class GeodeticPoint(NamedTuple):
    """A WGS84 position: degrees, degrees, ellipsoidal height in metres."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


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

    @property
    def K(self) -> FloatArray:
        """The (3, 3) calibration matrix of the undistorted (pinhole) image."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, kw_only=True)
class ImuMount:
    """Mounting of an IMU on the camera, and what a calibration found of its errors.

    Attributes:
        imu_R_camera: (3, 3) rotation from camera to IMU axes.
        imu_p_camera: (3,) camera in the IMU's frame, metres.
        gyro_bias_rad_s, accelerometer_bias_m_s2: (3,) expected biases in the IMU's axes, zero if unknown.
        gyro_density: White noise of the rates, rad/s/sqrt(Hz); None if the log is to tell it.
        accelerometer_density: White noise of the specific force, m/s^2/sqrt(Hz); None likewise.
    """

    imu_R_camera: FloatArray
    imu_p_camera: FloatArray = field(default_factory=lambda: np.zeros(3))
    gyro_bias_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    accelerometer_bias_m_s2: FloatArray = field(default_factory=lambda: np.zeros(3))
    gyro_density: float | None = None
    accelerometer_density: float | None = None


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
class GpsLog:
    """GPS fixes in chronological order, one row each; unknown numbers are NaN.

    Attributes:
        t_s: (N,) seconds since the video's first frame.
        latitude_deg, longitude_deg, height_m: (N,) WGS84, ellipsoidal height.
        fix_class: (N,) of :class:`FixClass`.
        sigma_m: (N, 3) standard deviations east, north, up, as reported by the receiver.
        hdop, satellites: (N,) horizontal dilution of precision, and number of satellites used.
        correction_age_s: (N,) age of the differential corrections.
        line: (N,) line of the fix in the file, from 1.
        source: The file.
        skipped: Notes on what the reader skipped or assumed (damaged lines, missing geoid separations).
        correlation: (N, 3) correlations of the errors east and north, east and up, north and up, as reported;
            0 where there is no report. None in runs of version 0.1.
    """

    t_s: FloatArray
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    height_m: FloatArray
    fix_class: tuple[FixClass, ...]
    sigma_m: FloatArray
    hdop: FloatArray
    satellites: FloatArray
    correction_age_s: FloatArray
    line: IntArray
    source: Path
    skipped: tuple[str, ...] = ()
    correlation: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.t_s)

    def rows(self, rows: IntArray | BoolArray) -> "GpsLog":
        """Return the fixes of some rows, in the order given."""
        index = np.arange(len(self))[rows]
        columns: dict[str, Any] = {
            name: value[index] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return replace(self, **columns, fix_class=tuple(self.fix_class[row] for row in index))


@dataclass(frozen=True)
class GyroLog:
    """Angular rates in the gyro's own axes, corrected by the rig: ``t_s`` (N,), ``rate_rad_s`` (N, 3)."""

    t_s: FloatArray
    rate_rad_s: FloatArray
    source: Path


@dataclass(frozen=True, kw_only=True)
class ImuLog:
    """Angular rates and specific force in the IMU's axes, on the video's clock.

    Attributes:
        t_s: (N,) strictly ascending.
        rate_rad_s: (N, 3).
        force_m_s2: (N, 3) specific force: acceleration minus gravity, upward at rest.
        saturated: (N,) samples at the end of the sensor's range.
        source: The file.
        notes: What the reader found: gaps, saturation.
    """

    t_s: FloatArray
    rate_rad_s: FloatArray
    force_m_s2: FloatArray
    saturated: BoolArray
    source: Path
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ControlPoints:
    """Control and check points: marks of known world position observed in frames, a row per observation.

    Control points start a run in Kume 2010 and hold it; check points only judge it.

    Attributes:
        name: (N,) the mark.
        frame: (N,) frame index of the observation.
        uv_px: (N, 2) observation in the distorted image.
        world_p_point: (N, 3) ENU metres, or latitude, longitude [deg], ellipsoidal height [m] if geodetic.
        sigma_m: (N, 3) standard deviations of the position east, north, up; 0 if it counts as exact.
        check: (N,) whether the mark is a check point.
        geodetic: Whether the positions are geodetic.
        source: The file.
        notes: What was assumed of the coordinates.
    """

    name: tuple[str, ...]
    frame: IntArray
    uv_px: FloatArray
    world_p_point: FloatArray
    sigma_m: FloatArray
    check: BoolArray
    geodetic: bool
    source: Path
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Frame:
    """One decoded frame: index, time [s], its luminance (H, W) uint8, and where it shows the scene (H, W)."""

    index: int
    t_s: float
    gray: GrayImage
    mask: BoolArray | None = None


class Masks(Protocol):
    """What the frames of a video show that is not of the scene."""

    @property
    def files(self) -> Sequence[Path]:
        """Their files."""
        ...

    def of_frame(self, index: int) -> BoolArray | None:
        """Return where a frame shows the scene (H, W); None if everywhere."""
        ...


class Video(Protocol):
    """A source of frames: a file, a folder of images, a stream."""

    @property
    def path(self) -> Path:
        """The file or folder."""
        ...

    @property
    def times_s(self) -> FloatArray:
        """(F,) presentation times, seconds since the first frame, strictly increasing."""
        ...

    @property
    def width(self) -> int:
        """Width in pixels, after the rotation by the container's flag."""
        ...

    @property
    def height(self) -> int:
        """Height in pixels, after the rotation by the container's flag."""
        ...

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order of presentation."""
        ...


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


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A recording: video, calibration and sensor logs, all on the video's clock.

    ``cameras`` are those of the rig beside ``camera``, the reference. ``notes`` says what was left out, and
    why. Without a calibration ``guesses`` says what the camera may be, and ``camera`` is the first of them.
    """

    path: Path
    video: Video
    camera: Camera
    rig: Rig
    gps: GpsLog | None = None
    gyro: GyroLog | None = None
    imu: ImuLog | None = None
    control_points: ControlPoints | None = None
    masks: Masks | None = None
    notes: tuple[str, ...] = ()
    guesses: tuple[CameraGuess, ...] = ()
    cameras: tuple[RigCamera, ...] = ()

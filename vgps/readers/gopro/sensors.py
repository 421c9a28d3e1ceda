"""GPS, gyro, accelerometer and exposure of a GoPro, from its video, on the video's clock.

GPS5 (up to HERO10), GPS9 (from HERO11) and GPRI (the Karma drone) are read. Times are STMP, microseconds from
the first frame's exposure; without them samples are spread over their payload. They include the receiver's
own delay of some tenths of a second between being at a position and reporting it.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.errors import GpsLogError, GyroLogError, ImuLogError, RecordingError, VgpsError
from vgps.geometry import interpolate_vectors
from vgps.model import FixClass, FloatArray, GyroLog, ImuLog
from vgps.readers.gopro.gpmf import Block, Telemetry, first_number
from vgps.readers.gopro.sample_times import sample_times
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, counted, from_sea_level, skipped
from vgps.readers.imu import checked_imu

# GoPro's axes: X to the left in the image, Y backward, Z up; checked on a MAX by gravity and by its
# orientation stream (CORI), whose rates are about the camera's axes
GYRO_R_CAMERA: FloatArray = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
_EACH_FRAME = ("SHUT", "ISOE", "CORI", "ISOG")  # streams with one sample per frame
_AXES = (("Hero6", "YxZ"), ("Fusion", "yXZ"))  # order of axes without ORIN; lower case is minus
_AXES_OF_OTHERS = "ZXY"
_FIX_2D, _FIX_3D = 2, 3
_MIN_SAMPLES = 2
_UNLOCKED = 99.99  # the DOP that the camera gives without a fix


# GPS streams, the preferred first: number of columns, and the first of latitude, longitude and height
_GPS = {"GPS9": (9, 0), "GPS5": (5, 0), "GPRI": (10, 1)}


def gps_stream(telemetry: Telemetry) -> str | None:
    """Return the key of the GPS stream to read: GPS9, else GPS5, else GPRI; None if there is none."""
    return next((key for key in _GPS if key in telemetry.sensors), None)


def read_gopro_gps(telemetry: Telemetry) -> RawLog:
    """Read GPS9, GPS5 or GPRI; ``line`` counts the samples, ``hdop`` is the camera's DOP.

    The class is single, the best of these receivers; samples without a fix are skipped. Heights are above the
    ellipsoid; above the sea, with a note, if GPSA says so and in GPRI, which wraps MAVLink's GPS_RAW_INT.

    Raises:
        GpsLogError: The video has no GoPro metadata, or no GPS in it.
    """
    key = gps_stream(telemetry)
    if key is None:
        what = "GoPro metadata without GPS" if telemetry.sensors else "a video without GoPro metadata"
        raise GpsLogError(
            what, file=telemetry.path, expected="GPS9, GPS5 or GPRI", remedy="give a GPS log with --gps"
        )
    sensor = telemetry.sensors[key]
    columns, column = _GPS[key]
    values, t_s = _values(telemetry, key, columns), _times(telemetry, key)
    fix, dop = _quality(sensor, key)
    placed = (values[:, column] != 0) | (values[:, column + 1] != 0)
    good = (fix >= _FIX_2D) & ~(dop >= _UNLOCKED) & placed
    fixes = []
    for row in np.flatnonzero(good).tolist():
        latitude, longitude, height = values[row, column : column + 3].tolist()
        at, dilution = float(t_s[row]), float(dop[row])
        fixes.append(Fix(at, latitude, longitude, height, FixClass.SINGLE, row + 1, hdop=dilution))
    notes = _notes(telemetry, sensor, good, fix)
    if key == "GPRI" or any(b"MSLV" in block.about["GPSA"].data for block in sensor if "GPSA" in block.about):
        fixes, about_heights = from_sea_level(fixes)
        notes += about_heights
    return RawLog(Clock.VIDEO, fixes, notes)


def read_gopro_gyro(telemetry: Telemetry) -> GyroLog | None:
    """Read angular rates about GoPro's axes X, Y, Z, see `GYRO_R_CAMERA`; None if there is no gyro.

    The stream's order of axes is ORIN's (``XzY`` is X, -Z, Y), or the one that GoPro documents for the model.
    The rates are those of the body; a stabilised image rotates differently, see `picture_rotations`.

    Raises:
        GyroLogError: The stream does not have three columns, or ORIN does not name three axes.
    """
    if "GYRO" not in telemetry.sensors:
        return None
    return GyroLog(*_vectors(telemetry, "GYRO", GyroLogError), telemetry.path)


def read_gopro_imu(telemetry: Telemetry) -> ImuLog | None:
    """Read angular rates and specific force about GoPro's axes, see `GYRO_R_CAMERA`; None without both.

    The force is interpolated to the times of the rates.

    Raises:
        ImuLogError: A stream does not have three columns, or its units are wrong.
    """
    if not {"GYRO", "ACCL"} <= telemetry.sensors.keys():
        return None
    t_s, rates = _vectors(telemetry, "GYRO", ImuLogError)
    force_t_s, force = _vectors(telemetry, "ACCL", ImuLogError)
    at_rates = interpolate_vectors(force_t_s, force, t_s)
    inside = (t_s >= force_t_s[0]) & (t_s <= force_t_s[-1])
    if inside.sum() < _MIN_SAMPLES:
        return None
    return checked_imu(t_s[inside], rates[inside], at_rates[inside], telemetry.path)


def _vectors(telemetry: Telemetry, key: str, error: type[VgpsError]) -> tuple[FloatArray, FloatArray]:
    """Return times (N,) and vectors (N, 3) of a sensor about GoPro's axes X, Y, Z."""
    values, order = _values(telemetry, key, 3), _axes(telemetry, key)
    if values.shape[1] != 3 or sorted(order.upper()) != ["X", "Y", "Z"]:
        found = f"{values.shape[1]} columns in the order {order!r}"
        raise error(found, file=telemetry.path, place=key, expected="3 axes")
    columns = [order.upper().index(axis) for axis in "XYZ"]
    signs = np.array([1.0 if axis in order else -1.0 for axis in "XYZ"])
    t_s, first = np.unique(_times(telemetry, key), return_index=True)
    return t_s, (values[:, columns] * signs)[first]


def gopro_exposures(telemetry: Telemetry) -> tuple[FloatArray, FloatArray] | None:
    """Return times (N,) and exposure times (N,) [s] of the frames (SHUT); None if there are none."""
    if "SHUT" not in telemetry.sensors:
        return None
    return _times(telemetry, "SHUT"), _values(telemetry, "SHUT", 1)[:, 0]


class PictureRotations(NamedTuple):
    """Rotations of a stabilised image at the frames.

    Attributes:
        t_s: (N,) times.
        first_R_camera: (N, 3, 3) from the image's axes to those of the first sample's reference.
        camera_R_body: (N, 3, 3) from the body's axes, those of a camera that is fixed to it, to the image's.
    """

    t_s: FloatArray
    first_R_camera: FloatArray
    camera_R_body: FloatArray


def picture_rotations(telemetry: Telemetry) -> PictureRotations | None:
    """Return the rotation of the stabilised image: the body's (CORI) and the stabilisation's (IORI).

    None without both streams. On a walk with a MAX, whose stabilisation rotated the image by up to 19
    degrees, the rates correlate to 0.9995 with those of poses from the video; the gyro's to 0.73.
    """
    if not {"CORI", "IORI"} <= telemetry.sensors.keys():
        return None
    camera, image = (_values(telemetry, key, 4)[:, [1, 2, 3, 0]] for key in ("CORI", "IORI"))
    n = min(len(camera), len(image))
    if not (np.any(camera[:n], axis=1) & np.any(image[:n], axis=1)).all():
        raise GyroLogError("a rotation of length zero", file=telemetry.path, place="CORI, IORI")
    t_s, first = np.unique(_times(telemetry, "CORI")[:n], return_index=True)
    on_body = Rotation.from_quat(image[first])
    rotation = on_body * Rotation.from_quat(camera[first])
    return PictureRotations(t_s, rotation.inv().as_matrix(), np.asarray(on_body.as_matrix()))


def picture_turn_rad(telemetry: Telemetry) -> float | None:
    """Return the largest rotation of the picture on the body (IORI) [rad]; None without IORI or CORI."""
    if not {"CORI", "IORI"} <= telemetry.sensors.keys():
        return None
    image = _values(telemetry, "IORI", 4)[:, [1, 2, 3, 0]]
    image = image[np.any(image, axis=1)]
    return float(Rotation.from_quat(image).magnitude().max()) if len(image) else None


def _values(telemetry: Telemetry, key: str, columns: int) -> FloatArray:
    """Return (N, k) values of a sensor; k is at least ``columns`` and the same in every payload."""
    widths = {block.samples.shape[1] for block in telemetry.sensors[key]}
    if len(widths) > 1 or min(widths) < columns:
        found = " and ".join(map(str, sorted(widths)))
        raise RecordingError(
            f"{found} columns",
            file=telemetry.path,
            place=key,
            expected=f"at least {columns}, the same in every payload",
        )
    return np.concatenate([block.samples for block in telemetry.sensors[key]])


def _times(telemetry: Telemetry, key: str) -> FloatArray:
    each_frame = next((name for name in _EACH_FRAME if name in telemetry.sensors), None)
    return sample_times(telemetry.sensors[key], telemetry.sensors[each_frame][0] if each_frame else None)


def _quality(sensor: list[Block], key: str) -> tuple[FloatArray, FloatArray]:
    """Return fix (2 or 3 dimensions, 0 none) and DOP of every sample; NaN where unknown."""
    if key != "GPS5":
        values = np.concatenate([block.samples for block in sensor])
        return values[:, 8], values[:, 7] if key == "GPS9" else np.full(len(values), np.nan)
    fix = [np.full(len(block.samples), first_number(block.about, "GPSF", _FIX_3D)) for block in sensor]
    dop = [np.full(len(block.samples), first_number(block.about, "GPSP", np.nan) / 100) for block in sensor]
    return np.concatenate(fix), np.concatenate(dop)


def _axes(telemetry: Telemetry, key: str) -> str:
    order = telemetry.sensors[key][0].about.get("ORIN")
    if order is not None:
        return order.data.decode("latin-1").strip("\0 ")
    return next((axes for name, axes in _AXES if name in telemetry.device), _AXES_OF_OTHERS)


def _notes(telemetry: Telemetry, sensor: list[Block], good: np.ndarray, fix: FloatArray) -> list[str]:
    notes = skipped(telemetry.damaged, "damaged payload", "of GoPro metadata")
    if not good.all():
        notes.append(f"{(~good).sum()} of {len(good)} GPS samples had no fix")
    flat = int((good & (fix < _FIX_3D)).sum())
    if flat:
        notes.append(f"{counted(flat, 'two-dimensional fix')} with guessed heights")
    if any(np.isnan(block.stamp_s) for block in sensor):
        notes.append(
            "no time stamps (STMP): times are those of the payloads, accurate to some tenths of a second"
        )
    return notes

"""A GoPro's own GPS, gyro and exposure, out of its video, on the video's clock.

GPS5 (up to HERO10), GPS9 (from HERO11) and GPRI (the Karma drone) are read. Times are STMP, in microseconds,
counted from the first frame's exposure; without them samples are spread over their payload. The receiver's
own delay, some tenths of a second between being at a place and reporting it, is still in them.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.errors import GpsLogError, GyroLogError, RecordingError
from vgps.model import FixClass, FloatArray, GyroLog
from vgps.readers.fixes import Clock, Fix, RawLog
from vgps.readers.gpmf import Block, Telemetry, first_number
from vgps.readers.gpmf_times import sample_times

# GoPro's axes: X to the left of the lens's view, Y backward, Z up; checked on a MAX by gravity and by its own
# orientation stream (CORI), whose rates are those of the camera's axes
GYRO_R_CAMERA: FloatArray = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
_EACH_FRAME = ("SHUT", "ISOE", "CORI", "ISOG")  # streams with a sample for every frame
_AXES = (("Hero6", "YxZ"), ("Fusion", "yXZ"))  # order of axes where no ORIN says it; a small letter is minus
_AXES_OF_OTHERS = "ZXY"
_FIX_2D, _FIX_3D = 2, 3
_UNLOCKED = 99.99  # the dilution that the camera gives without a fix


# GPS streams, the preferred first: number of columns, and the first of latitude, longitude and height
_GPS = {"GPS9": (9, 0), "GPS5": (5, 0), "GPRI": (10, 1)}


def looks_like_video(head: bytes) -> bool:
    """Whether the first bytes of a file are those of an MP4 or MOV."""
    return head[4:8] in {b"ftyp", b"moov", b"mdat", b"wide", b"skip", b"free"}


def gps_stream(telemetry: Telemetry) -> str | None:
    """Key of the GPS stream that is read: GPS9, else GPS5, else GPRI; None if there is none."""
    return next((key for key in _GPS if key in telemetry.sensors), None)


def read_gopro_gps(telemetry: Telemetry) -> RawLog:
    """Fixes of GPS9, GPS5 or GPRI; ``line`` counts the samples, ``hdop`` is the camera's DOP.

    The class is single, the best that these receivers reach; samples without a fix are passed over. Heights
    are as the camera gives them: above the ellipsoid, unless GPSA says above the sea (a note tells).

    Raises:
        GpsLogError: No metadata of a GoPro, or no GPS among them.
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
    return RawLog(Clock.VIDEO, fixes, _notes(telemetry, sensor, good, fix))


def read_gopro_gyro(telemetry: Telemetry) -> GyroLog | None:
    """Angular rates about GoPro's axes X, Y, Z, see `GYRO_R_CAMERA`; None if the camera gives none.

    The stream's own order is ORIN's (``XzY`` is X, -Z, Y), or that which GoPro documents for the model. The
    rates are the body's: a stabilised picture turns otherwise, see `picture_rotations`.

    Raises:
        GyroLogError: The stream has not three columns, or ORIN does not name three axes.
    """
    if "GYRO" not in telemetry.sensors:
        return None
    rates = _values(telemetry, "GYRO", 3)
    order = _axes(telemetry)
    if rates.shape[1] != 3 or sorted(order.upper()) != ["X", "Y", "Z"]:
        raise GyroLogError(
            f"{rates.shape[1]} columns in the order {order!r}",
            file=telemetry.path,
            place="GYRO",
            expected="3 axes",
        )
    columns = [order.upper().index(axis) for axis in "XYZ"]
    signs = np.array([1.0 if axis in order else -1.0 for axis in "XYZ"])
    t_s, first = np.unique(_times(telemetry, "GYRO"), return_index=True)
    return GyroLog(t_s, (rates[:, columns] * signs)[first], telemetry.path)


def gopro_exposures(telemetry: Telemetry) -> tuple[FloatArray, FloatArray] | None:
    """Times (N,) and exposure times (N,) [s] of the frames (SHUT); None if the camera gives none."""
    if "SHUT" not in telemetry.sensors:
        return None
    return _times(telemetry, "SHUT"), _values(telemetry, "SHUT", 1)[:, 0]


def picture_rotations(telemetry: Telemetry) -> tuple[FloatArray, FloatArray] | None:
    """How the picture turned: the camera's orientation (CORI) with what stabilisation did to it (IORI).

    Returns:
        Times (N,) and first_R_camera (N, 3, 3), from camera axes to those of the first sample's reference;
        None without both streams. Against poses from the video of a walk with a MAX, which was turned by up
        to 19 degrees by its stabilisation, the rates correlate to 0.9995; the gyro's own to 0.73.
    """
    if not {"CORI", "IORI"} <= telemetry.sensors.keys():
        return None
    camera, image = (_values(telemetry, key, 4)[:, [1, 2, 3, 0]] for key in ("CORI", "IORI"))
    n = min(len(camera), len(image))
    turned = Rotation.from_quat(image[:n]) * Rotation.from_quat(camera[:n])
    return _times(telemetry, "CORI")[:n], turned.inv().as_matrix()


def _values(telemetry: Telemetry, key: str, columns: int) -> FloatArray:
    """(N, k) values of a sensor, k at least ``columns`` and the same in every payload."""
    widths = {block.samples.shape[1] for block in telemetry.sensors[key]}
    if len(widths) > 1 or min(widths) < columns:
        found = " and ".join(map(str, sorted(widths)))
        raise RecordingError(
            f"{found} columns",
            file=telemetry.path,
            place=key,
            expected=f"at least {columns}, always the same",
        )
    return np.concatenate([block.samples for block in telemetry.sensors[key]])


def _times(telemetry: Telemetry, key: str) -> FloatArray:
    each_frame = next((name for name in _EACH_FRAME if name in telemetry.sensors), None)
    return sample_times(telemetry.sensors[key], telemetry.sensors[each_frame][0] if each_frame else None)


def _quality(sensor: list[Block], key: str) -> tuple[FloatArray, FloatArray]:
    """Fix (2 or 3 dimensions, 0 none) and dilution of every sample; NaN where the camera does not say it."""
    if key == "GPS9":
        values = np.concatenate([block.samples for block in sensor])
        return values[:, 8], values[:, 7]
    fix = [np.full(len(block.samples), first_number(block.about, "GPSF", _FIX_3D)) for block in sensor]
    dop = [np.full(len(block.samples), first_number(block.about, "GPSP", np.nan) / 100) for block in sensor]
    return np.concatenate(fix), np.concatenate(dop)


def _axes(telemetry: Telemetry) -> str:
    said = telemetry.sensors["GYRO"][0].about.get("ORIN")
    if said is not None:
        return said.data.decode("latin-1").strip("\0 ")
    return next((order for name, order in _AXES if name in telemetry.device), _AXES_OF_OTHERS)


def _notes(telemetry: Telemetry, sensor: list[Block], good: np.ndarray, fix: FloatArray) -> list[str]:
    notes = []
    if telemetry.damaged:
        notes.append(f"{telemetry.damaged} damaged payloads of GoPro metadata passed over")
    if not good.all():
        notes.append(f"{(~good).sum()} of {len(good)} GPS samples had no fix")
    flat = int((good & (fix < _FIX_3D)).sum())
    if flat:
        notes.append(f"{flat} fixes are two-dimensional: their heights are guesses")
    if any(b"MSLV" in block.about["GPSA"].data for block in sensor if "GPSA" in block.about):
        notes.append("heights are above the sea and taken as ellipsoidal: they may be off by 100 m")
    if any(np.isnan(block.stamp_s) for block in sensor):
        notes.append(
            "no time stamps (STMP): times are those of the payloads, good to some tenths of a second"
        )
    return notes

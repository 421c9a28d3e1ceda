"""A GoPro's own GPS, gyro and exposure, out of its video, on the video's clock."""

from pathlib import Path

import numpy as np

from vgps.errors import GpsLogError, GyroLogError
from vgps.model import FixClass, FloatArray, GyroLog
from vgps.readers.fixes import Clock, Fix, RawLog
from vgps.readers.gpmf import Block, blocks, numbers, sample_times

_EACH_FRAME = ("SHUT", "CORI", "ISOE")  # streams with a sample per frame
_FIX_3D = 3
_UNLOCKED = 99.99  # dilution that the camera gives without a fix


def looks_like_video(head: bytes) -> bool:
    """Whether the first bytes of a file are those of an MP4 or MOV."""
    return head[4:8] in {b"ftyp", b"moov", b"mdat"}


def read_gopro_gps(video: Path) -> RawLog:
    """Fixes of GPS9, else of GPS5, stamped by STMP and counted from the first frame.

    Heights are as the camera gives them, above the ellipsoid unless GPSA says above the sea. A camera's own
    GPS has no better class than single. Samples without a three-dimensional fix are passed over.

    Raises:
        GpsLogError: No metadata of a GoPro, or no GPS among them.
        RecordingError: The video cannot be read.
    """
    sensors = blocks(video)
    name = next((key for key in ("GPS9", "GPS5") if key in sensors), None)
    if name is None:
        what = "GoPro metadata without GPS" if sensors else "a video without GoPro metadata"
        raise GpsLogError(what, file=video, expected="GPS5 or GPS9", remedy="give a GPS log with --gps")
    sensor = sensors[name]
    t_s = _video_times(sensor, sensors, video)
    values = np.concatenate([block.samples for block in sensor])
    fix, dop = _quality(sensor, name)
    good = (fix >= _FIX_3D) & (dop < _UNLOCKED)
    notes = [] if good.all() else [f"{(~good).sum()} of {len(good)} GPS samples had no fix"]
    if any("GPSA" in block.about and b"MSLV" in block.about["GPSA"].data for block in sensor):
        notes.append("heights are above the sea (GPSA says MSLV) and taken as ellipsoidal")
    fixes = []
    for row in np.flatnonzero(good).tolist():
        latitude, longitude, height = values[row, :3].tolist()
        at, dilution = float(t_s[row]), float(dop[row])
        fixes.append(Fix(at, latitude, longitude, height, FixClass.SINGLE, row + 1, hdop=dilution))
    return RawLog(Clock.VIDEO, fixes, notes)


def read_gopro_gyro(video: Path) -> GyroLog | None:
    """Angular rates, their axes turned by MTRX to the order that ORIO names; None if there are none.

    Raises:
        GyroLogError: The stream is malformed.
        RecordingError: The video cannot be read.
    """
    sensors = blocks(video)
    if "GYRO" not in sensors:
        return None
    sensor = sensors["GYRO"]
    rates = np.concatenate([block.samples for block in sensor])
    if rates.shape[1] != 3:
        raise GyroLogError(f"GYRO has {rates.shape[1]} columns", file=video, expected="3")
    matrix = sensor[0].about.get("MTRX")
    if matrix is not None:
        rates = rates @ numbers(matrix).reshape(3, 3).T
    return GyroLog(_video_times(sensor, sensors, video), rates, video)


def gopro_speeds(video: Path) -> tuple[FloatArray, FloatArray]:
    """Times (N,) and three-dimensional Doppler speeds (N,) [m/s] of the GPS samples."""
    sensors = blocks(video)
    sensor = sensors["GPS9" if "GPS9" in sensors else "GPS5"]
    return _video_times(sensor, sensors, video), np.concatenate([block.samples[:, 4] for block in sensor])


def _quality(sensor: list[Block], name: str) -> tuple[FloatArray, FloatArray]:
    """Fix (2 or 3 dimensions, 0 none) and dilution of every sample."""
    if name == "GPS9":
        values = np.concatenate([block.samples for block in sensor])
        return values[:, 8], values[:, 7]
    fix, dop = [], []
    for block in sensor:
        n = len(block.samples)
        fix.append(np.full(n, numbers(block.about["GPSF"])[0, 0] if "GPSF" in block.about else _FIX_3D))
        dop.append(np.full(n, numbers(block.about["GPSP"])[0, 0] / 100 if "GPSP" in block.about else np.nan))
    return np.concatenate(fix), np.nan_to_num(np.concatenate(dop), nan=0.0)


def _video_times(sensor: list[Block], sensors: dict[str, list[Block]], video: Path) -> FloatArray:
    """Sample times from the first frame on: the first stamp of a stream that has a sample per frame."""
    if any(np.isnan(block.stamp_s) for block in sensor):
        raise GpsLogError(
            "GoPro metadata without time stamps (STMP)", file=video, expected="a HERO8, MAX or later camera"
        )
    first = next((sensors[key][0].stamp_s for key in _EACH_FRAME if key in sensors), sensor[0].stamp_s)
    return sample_times(sensor) - first

"""The GPS log that a camera wrote into its video."""

from pathlib import Path

from vgps.errors import GpsLogError
from vgps.readers.camm import read_camm
from vgps.readers.dji_metadata import read_dji_metadata
from vgps.readers.dji_srt import read_subtitle_track
from vgps.readers.fixes import RawLog
from vgps.readers.gopro import gps_stream, read_gopro_gps
from vgps.readers.gpmf import Telemetry, read_gpmf

_OTHERS = (read_dji_metadata, read_camm, read_subtitle_track)


def looks_like_video(head: bytes) -> bool:
    """Whether the first bytes of a file are those of an MP4 or MOV."""
    return head[4:8] in {b"ftyp", b"moov", b"mdat", b"wide", b"skip", b"free"}


def find_video_gps(video: Path, telemetry: Telemetry) -> RawLog | None:
    """Return the log in a video: a GoPro's, a DJI drone's metadata or subtitles, or CAMM; None without one.

    A GoPro's may have no fix.

    Raises:
        RecordingError: The video cannot be read.
    """
    if gps_stream(telemetry) is not None:
        return read_gopro_gps(telemetry)
    if telemetry.sensors:
        return None
    return next((log for read in _OTHERS if (log := read(video)) is not None), None)


def read_video_gps(video: Path, telemetry: Telemetry | None = None) -> RawLog:
    """Read the log in a video, see :func:`find_video_gps`; ``telemetry`` is its GoPro's, if it was read.

    Raises:
        GpsLogError: The video has none.
    """
    telemetry = read_gpmf(video) if telemetry is None else telemetry
    found = find_video_gps(video, telemetry)
    if found is None:
        raise GpsLogError(
            "GoPro metadata without GPS" if telemetry.sensors else "a video without GPS",
            file=video,
            expected="GPS9, GPS5 or GPRI of a GoPro, a DJI drone's metadata or subtitles, or CAMM",
            remedy="give a GPS log with --gps",
        )
    return found

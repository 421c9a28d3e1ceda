"""The GPS log that a camera wrote into its video."""

from pathlib import Path

from vgps.errors import GpsLogError
from vgps.readers.gopro.gpmf import Telemetry, read_gpmf
from vgps.readers.gopro.sensors import gps_stream, read_gopro_gps
from vgps.readers.gps_formats.fixes import RawLog
from vgps.readers.video.mp4_boxes import track_kinds
from vgps.readers.video.tags import video_tags
from vgps.readers.video_gps.camm import read_camm
from vgps.readers.video_gps.dashcam import read_dashcam
from vgps.readers.video_gps.dji_metadata import read_dji_metadata
from vgps.readers.video_gps.dji_srt import read_subtitle_track
from vgps.readers.video_gps.quicktime_places import read_quicktime_places

_METADATA = {"camm", "CTMD", "djmd", "gpmd", "mebx", "mett", "rtmd", "text", "tx3g"}  # kinds of tracks
_PLACES = ("location.ISO6709", "location")  # of Apple, and of Android as FFmpeg names it
_OTHERS = (read_dji_metadata, read_camm, read_quicktime_places, read_subtitle_track, read_dashcam)


def looks_like_video(head: bytes) -> bool:
    """Whether the first bytes of a file are those of an MP4 or MOV."""
    return head[4:8] in {b"ftyp", b"moov", b"mdat", b"wide", b"skip", b"free"}


def find_video_gps(video: Path, telemetry: Telemetry) -> RawLog | None:
    """Return a GoPro's log in a video, a DJI drone's, CAMM's, a phone's or a dashcam's; None without one.

    A GoPro's may have no fix.

    Raises:
        RecordingError: The video cannot be read.
    """
    if gps_stream(telemetry) is not None:
        return read_gopro_gps(telemetry)
    if telemetry.sensors:
        return None
    return next((log for read in _OTHERS if (log := read(video)) is not None), None)


def unread_metadata(video: Path) -> str:
    """Return what a video without a log has that may be about places: a tag, tracks; empty without any."""
    tags, kinds = video_tags(video), sorted(_METADATA.intersection(track_kinds(video).values()))
    found = ["one place for the whole video" for name in _PLACES if name in tags][:1]
    if kinds:
        found.append(f"metadata without positions that can be read ({', '.join(kinds)})")
    return " and ".join(found)


def read_video_gps(video: Path, telemetry: Telemetry | None = None) -> RawLog:
    """Read the log in a video, see :func:`find_video_gps`; ``telemetry`` is its GoPro's, if it was read.

    Raises:
        GpsLogError: The video has none.
    """
    telemetry = read_gpmf(video) if telemetry is None else telemetry
    found = find_video_gps(video, telemetry)
    if found is None:
        what, unread = "a video without GPS", unread_metadata(video)
        if unread:
            what += f", with {unread}"
        raise GpsLogError(
            "GoPro metadata without GPS" if telemetry.sensors else what,
            file=video,
            expected="GPS of a GoPro, DJI's metadata or subtitles, CAMM, places in mebx, a dashcam's blocks",
            remedy="give a GPS log with --gps",
        )
    return found

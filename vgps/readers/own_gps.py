"""The fixes that a recording has without a GPS log: in its video, beside it, in its pictures or its bag."""

import logging
from pathlib import Path

from vgps.errors import GpsLogError
from vgps.model import GpsLog, Rig
from vgps.readers.bag import BagVideo
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.gps import gps_format, gps_log, read_gps_log
from vgps.readers.overlap import check_overlap
from vgps.readers.sources import Source
from vgps.readers.video.exif import exif_fixes
from vgps.readers.video.images import ImageFolder
from vgps.readers.video_gps.dji_srt import files_beside
from vgps.readers.video_gps.find import find_video_gps, unread_metadata

log = logging.getLogger(__name__)


def own_gps(video: Source, rig: Rig, telemetry: Telemetry) -> GpsLog | None:
    """Return a recording's own fixes; None if it has none that can be used.

    Raises:
        GpsLogError: No fix is during the video.
    """
    if isinstance(video, ImageFolder):
        taken = [video.taken(index) for index in range(len(video.files))]
        raw = exif_fixes(taken, video.times_s)
        return gps_log(raw, rig, video.path) if raw.fixes else None
    if isinstance(video, BagVideo):
        raw = video.fixes()
        return gps_log(raw, rig, video.path) if raw.fixes else None
    found = find_video_gps(video.path, telemetry)
    if found is not None and found.fixes:
        fixes = gps_log(found, rig, video.path)
    elif (beside := _subtitles_beside(video.path, rig)) is not None:
        fixes = beside
    else:
        if found is not None:
            log.warning("%s: the camera's GPS never had a fix; continuing without GPS", video.path)
        elif not telemetry.sensors and (unread := unread_metadata(video.path)):
            log.warning("%s: has %s; continuing without GPS", video.path, unread)
        return None
    check_overlap(fixes, video.times_s, rig)
    return fixes


def _subtitles_beside(video: Path, rig: Rig) -> GpsLog | None:
    """Return the fixes of a drone's subtitles beside its video; None without any."""
    for file in files_beside(video):
        if gps_format(file) == "srt":
            try:
                return read_gps_log(file, rig)
            except GpsLogError as error:
                log.warning("%s; continuing without GPS", error)
    return None

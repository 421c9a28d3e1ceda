"""Fixes in a camera motion metadata track (CAMM), as phones and 360 degree cameras write it for Street View.

Format: https://developers.google.com/streetview/publish/camm-spec. Each packet has two bytes of padding, two
of a type, and little-endian values; types 5 and 6 are positions.
"""

import struct
from pathlib import Path

import numpy as np

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import (
    Clock,
    Fix,
    RawLog,
    axis_sigmas,
    skipped,
    with_a_height,
    without_repeats,
)
from vgps.readers.video.metadata_tracks import Packet, packets_of

_TYPE = struct.Struct("<2xH")
_PLAIN, _FULL = 5, 6
_NO_FIX, _FLAT = 0, 2  # what the fix of a full position may be; 3 has a height
_PLACE = struct.Struct("<4x3d")  # latitude, longitude, altitude
_GPS = struct.Struct("<4x8xi2d3f")  # behind a time: fix, latitude, longitude, altitude, accuracies


def read_camm(video: Path) -> RawLog | None:
    """Read the fixes of a CAMM track; None if the video has no such track, or no fix in it.

    Every fix is single. Times are those of the container, heights ellipsoidal; the stated horizontal accuracy
    is that of both axes together. Full positions stand for plain ones if a track has both.

    Raises:
        RecordingError: The video cannot be read.
    """
    found: dict[int, list[Fix]] = {_PLAIN: [], _FULL: []}
    damaged = 0
    for number, packet in enumerate(packets_of(video, "camm"), 1):
        try:
            (kind,) = _TYPE.unpack_from(packet.data)
            fix = _fix(packet, kind, number)
        except struct.error:
            damaged += 1
            continue
        if fix is not None:
            found[kind].append(fix)
    fixes, notes = without_repeats(found[_FULL] or found[_PLAIN], "packet")
    fixes, about_heights = with_a_height(fixes)
    lost = skipped(damaged, "damaged packet", "of CAMM metadata")
    return RawLog(Clock.VIDEO, fixes, [*about_heights, *notes, *lost]) if fixes else None


def _fix(packet: Packet, kind: int, number: int) -> Fix | None:
    """Return the fix of a packet of a type; None for packets of other sensors, and without a fix.

    Raises:
        struct.error: It is too short.
    """
    around_m = up_m = 0.0
    if kind == _PLAIN:
        latitude, longitude, height = _PLACE.unpack_from(packet.data)
    elif kind == _FULL:
        status, latitude, longitude, height, around_m, up_m = _GPS.unpack_from(packet.data)
        if status == _NO_FIX:
            return None
        height = np.nan if status == _FLAT else height
    else:
        return None
    if latitude == longitude == 0.0:
        return None
    sigma_m = axis_sigmas(around_m, up_m)
    return Fix(packet.start_s, latitude, longitude, height, FixClass.SINGLE, number, sigma_m)

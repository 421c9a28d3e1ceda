"""Fixes in a dashcam's MP4, as cameras with Novatek's chips write them (Viofo, Rove, Vantrue and many more).

The box ``moov/gps `` lists the places and sizes of blocks in the file, one a second, that begin with a size
and ``freeGPS ``. What follows differs by vendor. Read are a time, a date, three letters and two floats, types
3 and 16 in ExifTool's QuickTimeStream.pl, and the same with doubles, type 15. Latitude and longitude are
NMEA's: degrees times 100 plus minutes. Some cameras of E-ACE and Akaso have text or encrypted numbers at the
place of the floats, types 4 and 8; these are not read.
"""

import logging
import math
import re
import statistics
import struct
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, skipped, with_a_height, without_repeats
from vgps.readers.video.metadata_tracks import length_s
from vgps.readers.video.mp4_boxes import read_box

log = logging.getLogger(__name__)

_ENTRY = struct.Struct(">II")
_HEAD_BYTES = 8  # of the list, before its entries
_BLOCK_BYTES = 104  # of a block, as far as the layouts go
_MARK = b"freeGPS "
_FLOATS = struct.Struct("<6I3sx2f")  # time, date, status and hemispheres, latitude and longitude
_FLOATS_AT = (16, 48)
_DOUBLES = struct.Struct("<16x3Ic3xdc7xdc23x3I")  # the same, the date at the end
_TEXT = re.compile(rb"[A-Za-z0-9+/.]{8}")
_NOTE = "a dashcam's fixes have whole seconds, counted from the start of the video: they may be a second off"
_NOT_READ = (
    "%s: none of its %d GPS blocks (freeGPS) has a fix in a layout that is read; if it has fixes, convert "
    "them to GPX, for example with exiftool -ee, and give that with --gps"
)

_Place = tuple[float, float, float]  # UTC [s], latitude and longitude [degrees]


def read_dashcam(video: Path) -> RawLog | None:
    """Read the fixes of a dashcam's video; None if it has none, with a log if it has blocks.

    Every fix is single, and horizontal since blocks have no heights; ``line`` counts the blocks. Times are
    those of the blocks' clock, which is put on the video's by the median block's share of the video's length.

    Raises:
        RecordingError: The video cannot be read.
    """
    blocks = list(_blocks(video))
    found = [(index, place) for index, block in enumerate(blocks) if (place := _place(block)) is not None]
    if not found:
        if blocks:
            log.warning(_NOT_READ, video, len(blocks))
        return None
    period_s = length_s(video) / len(blocks)
    start_utc_s = statistics.median(utc_s - period_s * index for index, (utc_s, _, _) in found)
    placed = [
        Fix(utc_s - start_utc_s, north, east, math.nan, FixClass.SINGLE, index + 1)
        for index, (utc_s, north, east) in found
    ]
    fixes, notes = without_repeats(placed, "block")
    fixes, about_heights = with_a_height(fixes)
    lost = skipped(len(blocks) - len(found), "block", "without a fix")
    return RawLog(Clock.VIDEO, fixes, [*about_heights, *notes, *lost], doubts=[_NOTE])


def _blocks(video: Path) -> Iterator[bytes]:
    """Yield the beginnings of the blocks in the order of their list."""
    entries = (read_box(video, "moov", "gps ") or b"")[_HEAD_BYTES:]
    whole = len(entries) // _ENTRY.size * _ENTRY.size
    with video.open("rb") as stream:
        for offset, size in _ENTRY.iter_unpack(entries[:whole]):
            stream.seek(offset)
            block = stream.read(min(size, _BLOCK_BYTES))
            if block[4 : 4 + len(_MARK)] == _MARK:
                yield block.ljust(_BLOCK_BYTES, b"\0")


def _place(block: bytes) -> _Place | None:
    """Return what a block says; None without a fix, or if no known layout fits."""
    for at in _FLOATS_AT:
        *clock, letters, north, east = _FLOATS.unpack_from(block, at)
        if _is_fix(letters):
            text = _TEXT.match(block, at + _FLOATS.size - 8)
            return None if text else _checked(clock, letters, north, east)
    *clock, status, north, south, east, west, year, month, day = _DOUBLES.unpack_from(block)
    letters = status + south + west
    return _checked([*clock, year, month, day], letters, north, east) if _is_fix(letters) else None


def _is_fix(letters: bytes) -> bool:
    return letters[0] in b"A" and letters[1] in b"NS" and letters[2] in b"EW"


def _checked(clock: list[int], letters: bytes, north: float, east: float) -> _Place | None:
    """Return time and degrees; None for impossible ones."""
    hour, minute, second, year, month, day = clock
    latitude, longitude = _degrees(north), _degrees(east)
    if not (0.0 < latitude <= 90.0 and 0.0 < longitude <= 180.0):
        return None
    try:
        utc = datetime(year % 2000 + 2000, month, day, hour, minute, second, tzinfo=UTC)
    except (ValueError, OverflowError):
        return None
    signs = [-1.0 if letter in b"SW" else 1.0 for letter in letters[1:]]
    return utc.timestamp(), signs[0] * latitude, signs[1] * longitude


def _degrees(value: float) -> float:
    """Return degrees of NMEA's degrees times 100 plus minutes, the sign dropped."""
    return abs(value) // 100.0 + abs(value) % 100.0 / 60.0

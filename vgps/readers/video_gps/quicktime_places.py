"""Fixes in a QuickTime track of timed metadata (mebx), as apps on iPhones write it.

Format: the timed metadata media of the QuickTime File Format. The sample description says which key each
number stands for; a packet holds the values of some keys behind their numbers. A place is text by ISO 6709,
``+47.5000+008.2500+500.000/``: degrees, degrees and minutes, or those and seconds; and metres above the sea.
The camera app itself writes one place for the whole video instead.
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import (
    Clock,
    Fix,
    RawLog,
    axis_sigmas,
    from_sea_level,
    skipped,
    with_a_height,
    without_repeats,
)
from vgps.readers.video.metadata_tracks import Packet, packets
from vgps.readers.video.mp4_boxes import inner_boxes, sample_descriptions

_PLACE = "com.apple.quicktime.location.ISO6709"
_ACCURACY = "com.apple.quicktime.location.accuracy.horizontal"
_KEYS_AT = 16  # in a sample description: behind size, kind, reserved bytes and a reference
_NAME_AT = 4  # in the declaration of a key: behind its namespace
_SIXTIETHS = r"(?:\d\d){0,2}(?:\.\d*)?"  # minutes, and seconds
_ISO_6709 = re.compile(
    rf"([+-]\d\d{_SIXTIETHS})([+-]\d\d\d{_SIXTIETHS})([+-]\d+(?:\.\d*)?)?(?:CRS[^/]*)?/?\Z"
)


def read_quicktime_places(video: Path) -> RawLog | None:
    """Read the fixes of a track of timed metadata; None if the video has none with a place.

    Every fix is single. Times are those of the container, heights are above the sea; a stated horizontal
    accuracy is that of both axes together.

    Raises:
        RecordingError: The video cannot be read.
    """
    for track, description in sample_descriptions(video).items():
        keys = _keys(description) if description[4:8] == b"mebx" else {}
        if _PLACE in keys.values():
            return _log(video, track, keys)
    return None


def _keys(description: bytes) -> dict[str, str]:
    """Return the name of each key by the number, as four letters, that stands for it in packets."""
    return {
        number: declaration[_NAME_AT:].decode("utf-8", "replace")
        for name, table in inner_boxes(description, _KEYS_AT)
        if name == "keys"
        for number, key in inner_boxes(table)
        for part, declaration in inner_boxes(key)
        if part == "keyd"
    }


def _log(video: Path, track: int, keys: Mapping[str, str]) -> RawLog | None:
    found: list[Fix | None] = []
    for number, packet in enumerate(packets(video, lambda stream: stream.id == track), 1):
        values = {keys.get(name, ""): value for name, value in inner_boxes(packet.data)}
        if _PLACE in values:
            found.append(_fix(packet, values, number))
    fixes, notes = without_repeats([fix for fix in found if fix is not None], "packet")
    fixes, about_sea = from_sea_level(fixes)
    fixes, about_none = with_a_height(fixes)
    lost = skipped(found.count(None), "place", "not written as in ISO 6709")
    return RawLog(Clock.VIDEO, fixes, [*about_sea, *about_none, *notes, *lost]) if fixes else None


def _fix(packet: Packet, values: Mapping[str, bytes], number: int) -> Fix | None:
    place = _ISO_6709.match(values[_PLACE].decode("ascii", "replace").strip("\0 "))
    if place is None:
        return None
    latitude, longitude = _degrees(place[1], 2), _degrees(place[2], 3)
    height = math.nan if place[3] is None else float(place[3])
    sigma_m = axis_sigmas(_number(values.get(_ACCURACY, b"")))
    return Fix(packet.start_s, latitude, longitude, height, FixClass.SINGLE, number, sigma_m)


def _degrees(text: str, digits: int) -> float:
    """Return degrees; ``digits`` before the point are degrees, two more minutes, and two more seconds."""
    whole, point, rest = text[1:].partition(".")
    degrees, parts = whole[:digits], [whole[at : at + 2] for at in range(digits, len(whole), 2)]
    *upper, last = [degrees, *parts]
    size = sum(float(part) / 60.0**k for k, part in enumerate([*upper, last + point + rest]))
    return -size if text[0] == "-" else size


def _number(text: bytes) -> float:
    """Return a number given as text; NaN if it is none."""
    try:
        return float(text.decode("ascii", "replace").strip("\0 "))
    except ValueError:
        return math.nan

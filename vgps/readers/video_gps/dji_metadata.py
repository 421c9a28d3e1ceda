"""Positions in the metadata track (``djmd``) of DJI's newer drones and action cameras.

Each packet is a protobuf message without a published schema. The fields' numbers are those of ExifTool's
table of DJI's tags for Mavic 3, Air 3, Mini 4 Pro, Matrice 30, Avata 2, Neo, Osmo Action 4 and others: a
message of the position has GPS (units, latitude, longitude) and the height in millimetres.
"""

import math
import struct
from pathlib import Path

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, from_sea_level, skipped, without_repeats
from vgps.readers.video.metadata_tracks import packets_of

Message = dict[int, int | float | bytes]
"""The last value of each field: of a varint an integer, of 64 bits a float, bytes of what has a length."""

_TRACK = "djmd"
_POSITIONS = ((3, 3, 4), (3, 4, 4), (3, 4, 2))  # drones; Avata 2 and Neo; action cameras
_PROTOCOL = (1, 1, 1)
_GPS, _HEIGHT_MM = 1, 2  # in a position
_UNITS, _LATITUDE, _LONGITUDE = 1, 2, 3  # in GPS
_DEGREES = 1
_ALWAYS_DEGREES = ("dvtm_Mavic4", "dvtm_Mini5Pro")  # whatever the units say
_HAND_HELD = ("dvtm_ac", "dvtm_oq")  # action cameras
_NOWHERE_DEG = 1e-6  # latitude and longitude without a fix
_WRAPS = 1 << 64  # varints of negative numbers are their two's complement in 64 bits


def read_dji_metadata(video: Path) -> RawLog | None:
    """Read a camera's positions; None if the video has no such track, or none in it.

    Every fix is single. Heights are above the sea, plus the geoid's.

    Raises:
        RecordingError: The video cannot be read.
    """
    found, protocol, damaged = list[Fix](), "", 0
    for number, packet in enumerate(packets_of(video, _TRACK), 1):
        try:
            message = parse(packet.data)
            protocol = protocol or _protocol(message)
            place = position(message, protocol.startswith(_ALWAYS_DEGREES))
        except ValueError:
            damaged += 1
            continue
        if place is not None:
            found.append(Fix(packet.start_s, *place, FixClass.SINGLE, number))
    fixes, notes = without_repeats(found, "packet")
    if not fixes:
        return None
    fixes, about_heights = from_sea_level(fixes)
    lost = skipped(damaged, "damaged packet", "of DJI metadata")
    airborne = not protocol.startswith(_HAND_HELD)
    return RawLog(Clock.VIDEO, fixes, [*about_heights, *notes, *lost], airborne=airborne)


def dji_names(video: Path) -> list[str]:
    """Return the texts of the header in a video's first packet, such as protocol and model; often none.

    Raises:
        RecordingError: The video cannot be read.
    """
    try:
        first = b"".join(packet.data for packet in packets_of(video, _TRACK, most=1))
        header = _inner(parse(first), _PROTOCOL[:-1])
    except ValueError:
        return []
    texts = (value.decode("latin-1") for value in header.values() if isinstance(value, bytes))
    return [text for text in texts if text.isprintable()]


def position(message: Message, in_degrees: bool = False) -> tuple[float, float, float] | None:
    """Return latitude, longitude [deg] and height above the sea [m] of a message; None without a fix.

    Raises:
        ValueError: The message is damaged.
    """
    for path in _POSITIONS:
        place = _inner(message, path)
        gps = _inner(place, (_GPS,))
        latitude, longitude = gps.get(_LATITUDE), gps.get(_LONGITUDE)
        if not isinstance(latitude, float) or not isinstance(longitude, float):
            continue
        if not in_degrees and gps.get(_UNITS, 0) != _DEGREES:
            latitude, longitude = math.degrees(latitude), math.degrees(longitude)
        if max(abs(latitude), abs(longitude)) < _NOWHERE_DEG:
            return None
        height = place.get(_HEIGHT_MM, 0)  # protobuf omits zeros
        height_mm = height if isinstance(height, int) else 0
        return latitude, longitude, 1e-3 * (height_mm - _WRAPS if height_mm >= _WRAPS // 2 else height_mm)
    return None


def parse(data: bytes) -> Message:
    """Return the fields of a protobuf message (its wire format, https://protobuf.dev).

    Raises:
        ValueError: It is damaged.
    """
    fields: Message = {}
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if wire == 0:
            fields[number], at = _varint(data, at)
            continue
        length = {1: 8, 5: 4}.get(wire, -1)
        if wire == 2:
            length, at = _varint(data, at)
        if not 0 <= length <= len(data) - at:
            raise ValueError(f"field {number} of type {wire} at {at}")
        value = data[at : at + length]
        fields[number] = struct.unpack("<d", value)[0] if wire == 1 else value
        at += length
    return fields


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            break
        value |= (data[at] & 0x7F) << shift
        at += 1
        if data[at - 1] < 0x80:
            return value, at
    raise ValueError(f"no end of a number at {at}")


def _inner(message: Message, path: tuple[int, ...]) -> Message:
    """Return the message at a path of fields, empty if there is none."""
    for number in path:
        inner = message.get(number)
        if not isinstance(inner, bytes):
            return {}
        message = parse(inner)
    return message


def _protocol(message: Message) -> str:
    name = _inner(message, _PROTOCOL[:-1]).get(_PROTOCOL[-1])
    return name.decode("latin-1") if isinstance(name, bytes) else ""

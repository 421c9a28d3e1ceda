"""Damage inside the messages of receivers and loggers, after which lengths and check sums are right again."""

import binascii
import random
import re
import struct

import pysbf2
from pymavlink.dialects.v20 import common as mavlink

from scripts.experiments.fuzz.mutators import damage_bytes, damage_numbers

_SBF = re.compile(rb"\$@..(..)(..)", re.DOTALL)
_NOVATEL = re.compile(rb"#([^*#\r\n]+)\*[0-9a-f]{8}")
_TIME_BYTES, _HEAD_BYTES, _CHECK_BYTES = 8, 10, 2  # of a message of a telemetry log
_FIT_HEAD, _FIT_FIELDS = 14, 6  # bytes of the file's header, and of a definition before its fields


def damage_sbf(data: bytes, rng: random.Random) -> bytes:
    """Damage the body of a block and correct its check sum."""
    match = rng.choice(list(_SBF.finditer(data)))
    end = match.start() + int.from_bytes(match[2], "little")
    body = _same_length(data[match.end() : end], rng)
    checked = data[match.start() + 4 : match.end()] + body
    total: bytes = pysbf2.crc2bytes(checked)
    return data[: match.start()] + b"$@" + total + checked + data[end:]


def damage_novatel(data: bytes, rng: random.Random) -> bytes:
    """Replace numbers of an ASCII message, or damage it, and correct its check sum."""
    match = rng.choice(list(_NOVATEL.finditer(data)))
    body = rng.choice((damage_numbers, damage_numbers, damage_bytes))(match[1], rng)
    # CRC-32 that begins with 0 and is not inverted
    total = binascii.crc32(body, 0xFFFFFFFF) ^ 0xFFFFFFFF
    return data[: match.start()] + b"#" + body + f"*{total:08x}".encode() + data[match.end() :]


def damage_telemetry(data: bytes, rng: random.Random) -> bytes:
    """Damage the payload of a MAVLink 2 message and correct its check sum."""
    starts, at = [], 0
    while at + _TIME_BYTES + _HEAD_BYTES < len(data):
        starts.append(at)
        at += _TIME_BYTES + _HEAD_BYTES + data[at + _TIME_BYTES + 1] + _CHECK_BYTES
    head = rng.choice(starts) + _TIME_BYTES
    end = head + _HEAD_BYTES + data[head + 1]
    body = data[head + 1 : head + _HEAD_BYTES] + _same_length(data[head + _HEAD_BYTES : end], rng)
    total = mavlink.x25crc(body + bytes([mavlink.MAVLink_gps_raw_int_message.crc_extra])).crc
    return data[: head + 1] + body + struct.pack("<H", total) + data[end + _CHECK_BYTES :]


def damage_fit(data: bytes, rng: random.Random) -> bytes:
    """Change number, size or type of a field in the first definition of a FIT file."""
    found = bytearray(data)
    fields = found[_FIT_HEAD + _FIT_FIELDS - 1]
    at = _FIT_HEAD + _FIT_FIELDS + 3 * rng.randrange(max(fields, 1)) + rng.randrange(3)
    found[at] = rng.choice((0, 1, 2, 4, 7, 8, 13, 253, 255, 0x83, 0x88, rng.randrange(256)))
    return bytes(found)


def _same_length(body: bytes, rng: random.Random) -> bytes:
    return damage_bytes(body, rng)[: len(body)].ljust(len(body), b"\xff")

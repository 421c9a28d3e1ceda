"""NMEA 0183 logs: GGA is the fix, GST its sigmas, GSA a DOP, ZDA or RMC the date.

Where no GGA has a fix, GNS is the fix, else RMC, else GLL, which have no heights.
"""

import math
import re
from collections.abc import Iterator
from datetime import date, time
from typing import Any

from pynmeagps import NMEAReader
from pynmeagps.exceptions import NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError
from pynmeagps.nmeahelpers import calc_checksum

from vgps.readers.gps_formats.fixes import DAY_S, RawLog, unix_day_s
from vgps.readers.gps_formats.nmea_epochs import (
    Anchor,
    Epoch,
    Reading,
    epoch_key,
    fix_class_of,
    log_of,
    number_of,
)

_PLACES = (b"GGA", b"GNS", b"RMC", b"GLL")  # sentences with a place, the preferred first
_SENTENCE = rb"\$[A-Z]{2}(%s|GST|GSA|ZDA|RMC),[^$*\r\n]*(?:\*[0-9A-Fa-f]{2}|\*[^$\r\n]*)?"
_OTHER = re.compile(rb"[\t \"#%-~]*[$!][A-Z][A-Z0-9]{2,},[^$]*\s*")  # a logger may write its time before it
_LEAP_SECOND = re.compile(rb"235960(\.\d*)?")
_ERRORS = (NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError, ValueError, IndexError, KeyError)
_LEAST_COMMAS = {b"GGA": 14, b"GNS": 12, b"RMC": 10, b"GLL": 6}  # a shorter one is cut off
_ABSURD = re.compile(rb"\d{19}")  # more digits than a 64-bit integer has


def looks_like_nmea(data: bytes) -> bool:
    """Whether there is a GGA sentence, in text or between binary messages."""
    return re.search(rb"\$[A-Z]{2}GGA,", data) is not None


def looks_like_nmea_without_gga(data: bytes) -> bool:
    """Whether there is a GNS, RMC or GLL sentence, which files of other formats may quote."""
    return re.search(rb"\$[A-Z]{2}(GNS|RMC|GLL),", data) is not None


def read_nmea(data: bytes) -> RawLog:
    """Read an NMEA log; damaged sentences are skipped and counted, other data between them is ignored.

    Sentences are joined to epochs by their time of day, which may pass midnight. The date comes from ZDA or
    RMC, anywhere in the log; without one, times count from a midnight. Height is altitude plus geoid
    separation; a missing separation is taken from the other fixes, or from EGM96. Notes say so, and whether
    the receiver's separations contradict EGM96. If no GGA has a fix, the first of GNS, RMC and GLL that has
    is read instead. Without any height fixes are horizontal. Notes say this, too.
    """
    empty = None
    for kind in _PLACES:
        if re.search(rb"\$[A-Z]{2}%s," % kind, data) is None:
            continue
        raw = _read(data, kind)
        if raw.fixes:
            if kind != _PLACES[0]:
                raw.notes.insert(0, f"no GGA with a fix: positions are those of {kind.decode()}")
            return raw
        empty = empty or raw
    return empty or _read(data, _PLACES[0])


def _read(data: bytes, place: bytes) -> RawLog:
    """Read a log with the places of one kind of sentence."""
    reading = Reading()
    sentences = list(_sentences(data, place, reading.damaged))
    # a log without any checksums is accepted
    checked = any(b"*" in raw for _, _, raw in sentences)
    for order, (line, kind, raw) in enumerate(sentences):
        # without a checksum a place may be cut off
        whole = kind == place and (place == b"GGA" or not checked)
        message = _parse(raw, checked, _LEAST_COMMAS[place] if whole else 0)
        if message is None:
            reading.damaged.append(line)
        else:
            _take(reading, (order, line, kind == place), message, raw)
    return log_of(reading)


def _sentences(data: bytes, place: bytes, damaged: list[int]) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield line, kind and bytes of each sentence of interest."""
    sentence = re.compile(_SENTENCE % place)
    binary = data.count(b"\0") > len(data) / 100  # messages of another protocol, not damage
    for number, line in enumerate(data.split(b"\n"), 1):
        found = list(sentence.finditer(line))
        yield from ((number, match[1], match[0].strip()) for match in found)
        known = found or binary or not line.strip() or line.startswith(b"#") or _OTHER.fullmatch(line)
        if not known:
            damaged.append(number)


def _parse(raw: bytes, checked: bool, least_commas: int) -> Any | None:
    if not re.search(rb"\*[0-9A-Fa-f]{2}$", raw):
        if checked or b"*" in raw or not raw.isascii():
            return None
        raw += b"*" + calc_checksum(raw[1:].decode()).encode()
    if raw.count(b",") < least_commas or _ABSURD.search(raw):
        return None
    try:
        return NMEAReader.parse(raw + b"\r\n")
    except _ERRORS:
        return None


def _take(reading: Reading, where: tuple[int, int, bool], message: Any, raw: bytes) -> None:
    """Add a sentence, given its number, its line and whether it is one with the place."""
    order, line, is_place = where
    if message.msgID == "GSA":
        if reading.epochs and math.isnan(reading.epochs[-1].hdop):
            reading.epochs[-1].hdop = number_of(message, "HDOP")
        return
    time_s = _time_of_day(message, raw)
    if time_s is None:
        if is_place and fix_class_of(message) is None:
            reading.untimed_empty += 1
        else:
            reading.untimed += is_place
        return
    if reading.time_s is not None:
        reading.day -= round((time_s - reading.time_s) / DAY_S)
    reading.time_s = time_s
    if is_place:
        hdop = number_of(message, "HDOP")
        reading.epochs.append(
            Epoch(order=order, line=line, day=reading.day, time_s=time_s, message=message, hdop=hdop)
        )
    if message.msgID == "GST":
        sigmas = [number_of(message, name) for name in ("stdLong", "stdLat", "stdAlt")]
        reading.sigmas[epoch_key(reading.day, time_s)] = (sigmas[0], sigmas[1], sigmas[2])
    elif (day := _date(message)) is not None:
        zero = unix_day_s(day) - reading.day * DAY_S
        reading.anchors.append(Anchor(order, reading.day, time_s, zero))


def _time_of_day(message: Any, raw: bytes) -> float | None:
    value = getattr(message, "time", None)
    if isinstance(value, time):
        return value.hour * 3600 + value.minute * 60 + value.second + value.microsecond * 1e-6
    fields = raw.split(b",")
    leap = _LEAP_SECOND.fullmatch(fields[min(5 if message.msgID == "GLL" else 1, len(fields) - 1)])
    return DAY_S + float(leap[1] or 0) if leap else None


def _date(message: Any) -> date | None:
    if message.msgID == "RMC":
        # before its first fix a receiver may give the date of its firmware
        valid = getattr(message, "status", "") == "A" and isinstance(getattr(message, "date", None), date)
        return message.date if valid else None
    try:
        return date(int(message.year), int(message.month), int(message.day))
    except (ValueError, OverflowError, TypeError, AttributeError):
        return None

"""GoPro's metadata track, GPMF: nested keys, lengths and values, about one payload a second.

Format, https://github.com/gopro/gpmf-parser: a key of four letters, a type, the size and the number of
structures, then big-endian data padded to four bytes. Type 0 contains nested entries.
"""

import re
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vgps.model import FloatArray
from vgps.readers.video.metadata_tracks import Packet, packets

_HEADER = struct.Struct(">4sBBH")
_REPEATED = re.compile(r"(.)\[(\d+)\]")  # "f[3]" stands for "fff" in a TYPE
_TRACK = ("GoPro MET", "gpmd")
_NUMBERS = {
    "b": "i1", "B": "u1", "s": ">i2", "S": ">u2", "l": ">i4", "L": ">u4",
    "j": ">i8", "J": ">u8", "f": ">f4", "d": ">f8",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A key with its data: ``kind`` is the type's letter ("" if nested), ``size`` bytes of a structure."""

    key: str
    kind: str
    size: int
    count: int
    data: bytes


@dataclass(frozen=True, kw_only=True)
class Block:
    """The samples of one sensor in one payload.

    Attributes:
        stamp_s: Time of the first sample (STMP), seconds on the camera's clock; NaN if unknown.
        samples: (n, k) scaled values.
        about: The other entries of the sensor's stream: fix, DOP, axes.
        start_s, duration_s: Time of the payload in the container, from the first frame.
    """

    stamp_s: float
    samples: FloatArray
    about: dict[str, Entry] = field(default_factory=dict)
    start_s: float = 0.0
    duration_s: float = 1.0


@dataclass(frozen=True)
class Telemetry:
    """The metadata of a GoPro video.

    Attributes:
        path: The video.
        device: The camera's name (DVNM), "" if it gives none.
        sensors: Blocks of every sensor, payload after payload, by key (``GPS5``, ``GYRO``, ``SHUT``...).
        damaged: Number of truncated or malformed payloads; entries before the damage are kept.
    """

    path: Path
    device: str = ""
    sensors: dict[str, list[Block]] = field(default_factory=dict)
    damaged: int = 0


def parse(data: bytes) -> Iterator[Entry]:
    """Yield the entries of a payload or of a nested entry, in order.

    Raises:
        ValueError: An entry reaches beyond the data.
    """
    at = 0
    while at + _HEADER.size <= len(data):
        key, kind, size, count = _HEADER.unpack_from(data, at)
        at += _HEADER.size
        if key == b"\0\0\0\0":
            return  # padding at the end
        length = size * count
        if at + length > len(data):
            raise ValueError(f"{key!r} has {length} bytes, expected at most {len(data) - at}")
        yield Entry(
            key=key.decode("latin-1"),
            kind=chr(kind) if kind else "",
            size=size,
            count=count,
            data=data[at : at + length],
        )
        at += -(-length // 4) * 4


def numbers(entry: Entry, structure: str = "") -> FloatArray:
    """Return the (count, k) unscaled values of an entry.

    Args:
        entry: An entry of a numeric type, or of type "?".
        structure: For type "?", one letter per value.

    Raises:
        ValueError: The type is not numeric, or the structure has another size.
    """
    letters = _REPEATED.sub(lambda match: match[1] * int(match[2]), structure)
    letters = letters if entry.kind == "?" else entry.kind
    if not letters or any(letter not in _NUMBERS for letter in letters):
        raise ValueError(f"{entry.key} has type {letters or entry.kind!r}, expected numbers")
    width = len(letters) if entry.kind == "?" else max(1, entry.size // np.dtype(_NUMBERS[letters]).itemsize)
    dtype = np.dtype([(str(k), _NUMBERS[letters[k % len(letters)]]) for k in range(width)])
    if dtype.itemsize != entry.size and entry.count:
        raise ValueError(f"{entry.key} has {entry.size} bytes, its type {letters} has {dtype.itemsize}")
    rows = np.frombuffer(entry.data, dtype, entry.count)
    columns = [rows[name].astype(np.float64) for name in dtype.names or ()]
    return np.stack(columns, axis=1)


def first_number(about: dict[str, Entry], key: str, default: float) -> float:
    """Return the first number of an entry; the default if there is no such entry or number."""
    try:
        values = numbers(about[key]) if key in about else np.zeros((0, 1))
    except ValueError:
        return default
    return float(values[0, 0]) if values.size else default


def _is_gpmf(stream: Any) -> bool:
    names = stream.metadata.get("handler_name", ""), getattr(stream, "codec_tag", None) or ""
    return stream.type == "data" and any(name in text for name in _TRACK for text in names)


def read_gpmf(video: str | Path) -> Telemetry:
    """Read the sensors of a GoPro video; no sensors if it is not a GoPro's.

    Streams without numbers are omitted.

    Raises:
        RecordingError: The video cannot be read.
    """
    return collect(Path(video), packets(Path(video), _is_gpmf))


def collect(video: Path, payloads: Iterable[Packet]) -> Telemetry:
    """Return the telemetry of a video's payloads, see `read_gpmf`."""
    sensors: dict[str, list[Block]] = {}
    device, damaged = "", 0
    for packet in payloads:
        try:
            for entry in parse(packet.data):
                for inner in parse(entry.data) if entry.key == "DEVC" else ():
                    if inner.key == "DVNM":
                        device = device or inner.data.decode("latin-1").strip("\0 ")
                    elif inner.key == "STRM":
                        _add(sensors, list(parse(inner.data)), packet)
        except ValueError:
            damaged += 1
    return Telemetry(video, device, sensors, damaged)


def _add(sensors: dict[str, list[Block]], entries: list[Entry], packet: Packet) -> None:
    """Add a stream, whose last entry has the samples and the others describe them."""
    if not entries:
        return
    *about, last = entries
    known = {entry.key: entry for entry in about}
    structure = known["TYPE"].data.decode("latin-1").strip("\0") if "TYPE" in known else ""
    try:
        values = numbers(last, structure)
    except ValueError:
        return  # text, or an unknown type
    if "SCAL" in known:
        scale = numbers(known["SCAL"]).ravel()
        if len(scale) not in {1, values.shape[1]} or not scale.all():
            raise ValueError(f"{last.key} has {values.shape[1]} columns and {len(scale)} scales")
        values = values / scale
    stamp_s = first_number(known, "STMP", float("nan")) * 1e-6
    block = Block(
        stamp_s=stamp_s, samples=values, about=known, start_s=packet.start_s, duration_s=packet.duration_s
    )
    sensors.setdefault(last.key, []).append(block)

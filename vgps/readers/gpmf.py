"""GoPro's metadata track, GPMF: nested keys, lengths and values, one payload a second beside the video.

The format is described at https://github.com/gopro/gpmf-parser: a key of four letters, a type, the size of a
structure and their number, then big-endian data padded to four bytes. Type 0 holds more of the same.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from vgps.errors import RecordingError
from vgps.model import FloatArray

_HEADER = struct.Struct(">4sBBH")
_NUMBERS = {
    "b": "i1", "B": "u1", "s": ">i2", "S": ">u2", "l": ">i4", "L": ">u4",
    "j": ">i8", "J": ">u8", "f": ">f4", "d": ">f8",
}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """A key with its data: ``kind`` the type's letter ("" for nested), ``size`` of a structure in bytes."""

    key: str
    kind: str
    size: int
    count: int
    data: bytes


@dataclass(frozen=True)
class Block:
    """What one payload says of one sensor.

    Attributes:
        stamp_s: Time of its first sample (STMP), seconds on the camera's clock; NaN if there is none.
        samples: (n, k) scaled values; (n,) structures of one value too are (n, 1).
        about: The other entries of the sensor's stream: fix, dilution, axes.
    """

    stamp_s: float
    samples: FloatArray
    about: dict[str, Entry]


def parse(data: bytes) -> Iterator[Entry]:
    """The entries of a payload or of a nested entry, in order.

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
            raise ValueError(f"{key!r} claims {length} bytes, {len(data) - at} are left")
        yield Entry(key.decode("latin-1"), chr(kind) if kind else "", size, count, data[at : at + length])
        at += -(-length // 4) * 4


def numbers(entry: Entry, structure: str = "") -> FloatArray:
    """(count, k) values of an entry as they stand, unscaled.

    Args:
        entry: Of a numeric type, or of type "?" with its ``structure``, a letter per value.

    Raises:
        ValueError: The type is none of numbers, or the structure has another size.
    """
    letters = structure if entry.kind == "?" else entry.kind
    if not letters or any(letter not in _NUMBERS for letter in letters):
        raise ValueError(f"{entry.key} has type {letters or entry.kind!r}, expected numbers")
    if entry.kind == "?":
        dtype = np.dtype([(str(k), _NUMBERS[letter]) for k, letter in enumerate(letters)])
        if dtype.itemsize != entry.size:
            raise ValueError(f"{entry.key} has {entry.size} bytes, its type {letters} has {dtype.itemsize}")
        rows = np.frombuffer(entry.data, dtype, entry.count)
        return np.stack([rows[name].astype(np.float64) for name in rows.dtype.names or ()], axis=1)
    values = np.frombuffer(entry.data, _NUMBERS[letters])
    return values.astype(np.float64).reshape(entry.count, -1)


def payloads(video: Path) -> list[bytes]:
    """The payloads of a video's GPMF track in order; none if it has no such track.

    Raises:
        RecordingError: The video cannot be read.
    """
    try:
        with av.open(str(video)) as container:
            tracks = [s for s in container.streams if "GoPro MET" in s.metadata.get("handler_name", "")]
            if not tracks:
                return []
            return [bytes(packet) for packet in container.demux(tracks[0]) if packet.size]
    except (av.FFmpegError, OSError) as error:
        raise RecordingError(f"cannot be read ({error})", file=video) from error


def blocks(video: Path) -> dict[str, list[Block]]:
    """What every sensor of a GoPro video says, payload after payload, by its key (``GPS5``, ``GYRO``...).

    Streams that hold no numbers are left out.

    Raises:
        RecordingError: The video cannot be read, or its metadata are damaged.
    """
    found: dict[str, list[Block]] = {}
    for number, payload in enumerate(payloads(video)):
        try:
            for device in parse(payload):
                for stream in (entry for entry in parse(device.data) if entry.key == "STRM"):
                    _add(found, list(parse(stream.data)))
        except ValueError as error:
            raise RecordingError(
                f"damaged GoPro metadata ({error})", file=video, place=f"payload {number}"
            ) from error
    return found


def _add(found: dict[str, list[Block]], entries: list[Entry]) -> None:
    if not entries:
        return
    *about, last = entries
    known = {entry.key: entry for entry in about}
    structure = known["TYPE"].data.decode("latin-1") if "TYPE" in known else ""
    try:
        values = numbers(last, structure)
    except ValueError:
        return
    if "SCAL" in known:
        values = values / numbers(known["SCAL"]).ravel()
    stamp_s = float(numbers(known["STMP"])[0, 0]) * 1e-6 if "STMP" in known else float("nan")
    found.setdefault(last.key, []).append(Block(stamp_s, values, known))


def sample_times(sensor: list[Block]) -> FloatArray:
    """Times of all samples of a sensor, seconds on the camera's clock.

    Each payload stamps its first sample; the others lie evenly between that and the next payload's, those of
    the last payload at the rate of the one before.

    Args:
        sensor: Its blocks, every one stamped.
    """
    stamps = [block.stamp_s for block in sensor]
    counts = [len(block.samples) for block in sensor]
    steps = [(b - a) / n if n else 0.0 for a, b, n in zip(stamps, stamps[1:], counts, strict=False)]
    steps.append(steps[-1] if steps else 1.0 / max(counts[-1], 1))
    return np.concatenate(
        [stamp + step * np.arange(n) for stamp, step, n in zip(stamps, steps, counts, strict=True)]
    )

"""Videos of dashcams with Novatek's chips, made by the description in readers/video_gps/dashcam.py."""

import struct
from pathlib import Path

from clips import write_clip

_BYTES = 256

Place = tuple[float, str, float, str]
Three = tuple[int, int, int]


def floats_block(
    place: Place, time: Three, date: Three, *, at: int, status: str = "A", century: int = 0
) -> bytes:
    """A block with floats behind its letters; ``century`` is part of its year."""
    north, south, east, west = place
    year, month, day = date
    clock = struct.pack("<6I", *time, year - 2000 + century, month, day)
    values = (status + south + west).encode() + b"\0" + struct.pack("<4f", north, east, 12.0, 90.0)
    return _head().ljust(at, b"\0") + clock + values + bytes(_BYTES - at - 44)


def doubles_block(place: Place, time: Three, date: Three) -> bytes:
    """A block with doubles, each before its letter, and the date behind them."""
    north, south, east, west = place
    values = struct.pack("<3I4sd8sd8s2d", *time, b"A", north, south.encode(), east, west.encode(), 12.0, 90.0)
    year, month, day = date
    return (_head() + bytes(4) + values + struct.pack("<3I", year - 2000, month, day)).ljust(_BYTES, b"\0")


def write_dashcam_video(path: Path, blocks: list[bytes], seconds: int = 1) -> Path:
    """A clip with a list of blocks in ``moov``, its last box, and blocks of the same size behind."""
    data = write_clip(path, frames=10 * seconds).read_bytes()
    moov = data.rindex(b"moov") - 4
    size = 16 + 8 * len(blocks)
    first = len(data) + size + 8
    entries = b"".join(struct.pack(">II", first + _BYTES * k, _BYTES) for k in range(len(blocks)))
    box = struct.pack(">I4s2I", size, b"gps ", 0x101, len(blocks)) + entries
    behind = struct.pack(">I4s", 8 + _BYTES * len(blocks), b"free") + b"".join(blocks)
    grown = struct.pack(">I", len(data) - moov + size)
    path.write_bytes(data[:moov] + grown + data[moov + 4 :] + box + behind)
    return path


def _head() -> bytes:
    return struct.pack("<I", _BYTES) + b"freeGPS "

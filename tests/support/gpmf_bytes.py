"""A tiny writer of GPMF, https://github.com/gopro/gpmf-parser, for payloads that tests know by heart."""

import struct
from pathlib import Path

import numpy as np

from vgps.readers.gopro.gpmf import Telemetry, collect
from vgps.readers.gopro.sample_times import sample_times
from vgps.readers.video.metadata_tracks import Packet

KINDS = {"b": "b", "B": "B", "s": "h", "S": "H", "l": "i", "L": "I", "f": "f", "d": "d", "j": "q", "J": "Q"}


def entry(key: str, kind: str, data: bytes, size: int, count: int) -> bytes:
    header = struct.pack(">4sBBH", key.encode("latin-1"), ord(kind) if kind else 0, size, count)
    return header + data + b"\0" * (-len(data) % 4)


def encode(key: str, kind: str, rows: list[list[float]]) -> bytes:
    """An entry of numbers, a row a structure."""
    width = len(rows[0]) if rows else 1
    body = b"".join(struct.pack(f">{width}{KINDS[kind]}", *row) for row in rows)
    return entry(key, kind, body, width * struct.calcsize(KINDS[kind]), len(rows))


def structures(key: str, types: str, rows: list[list[float]]) -> bytes:
    """The entry of type "?" whose TYPE is given elsewhere."""
    form = ">" + "".join(KINDS[letter] for letter in types)
    return entry(
        key, "?", b"".join(struct.pack(form, *row) for row in rows), struct.calcsize(form), len(rows)
    )


def text(key: str, content: str) -> bytes:
    return entry(key, "c", content.encode("latin-1"), 1, len(content))


def nest(key: str, *inner: bytes) -> bytes:
    data = b"".join(inner)
    return entry(key, "", data, 1, len(data))


def device(name: str, *streams: bytes) -> bytes:
    return nest("DEVC", encode("DVID", "L", [[1]]), text("DVNM", name), *streams)


def stream(last: bytes, *about: bytes, stamp_us: int | None = None) -> bytes:
    stamp = [] if stamp_us is None else [encode("STMP", "J", [[stamp_us]])]
    return nest("STRM", *stamp, *about, last)


def gps5(rows: list[tuple[float, ...]], fix: int = 3, dop: int = 154, stamp_us: int | None = None) -> bytes:
    """Rows of degrees, degrees, metres and two speeds, as a HERO writes them."""
    scale = [10_000_000, 10_000_000, 1000, 1000, 100]
    integers = [[round(x * s) for x, s in zip(row, scale, strict=True)] for row in rows]
    about = (
        encode("GPSF", "L", [[fix]]),
        text("GPSU", "241231235959.500"),
        encode("GPSP", "S", [[dop]]),
        encode("SCAL", "l", [[s] for s in scale]),
    )
    return stream(encode("GPS5", "l", integers), *about, stamp_us=stamp_us)


def telemetry(*payloads: bytes, duration_s: float = 1.0, starts_s: list[float] | None = None) -> Telemetry:
    """The payloads as a video that shows each for a second would give them."""
    starts = starts_s or [duration_s * index for index in range(len(payloads))]
    packed = [Packet(data, start, duration_s) for data, start in zip(payloads, starts, strict=True)]
    return collect(Path("walk.mp4"), packed)


def doppler_speeds(found: Telemetry) -> tuple[np.ndarray, np.ndarray]:
    """Times (N,) [s] and speeds (N, 2) [m/s], over ground and in space, of a GPS5 or GPS9 stream."""
    blocks = found.sensors.get("GPS9") or found.sensors["GPS5"]
    t_s = sample_times(blocks, found.sensors["SHUT"][0])
    return t_s, np.concatenate([block.samples for block in blocks])[:, 3:5]


ROW = (33.1267, -117.3273, -22.9, 1.2, 1.3)


def shutter(stamp_us: int, exposure_s: float = 0.01) -> bytes:
    return stream(encode("SHUT", "f", [[exposure_s]] * 30), stamp_us=stamp_us)


def walk(fix: int = 3, dop: int = 154):
    """Two payloads of four fixes each, stamped 0.1 s after the frames, and the second with another fix."""
    first = device("Hero9", shutter(500_000), gps5([ROW] * 4, 3, 154, 600_000))
    second = device("Hero9", shutter(1_500_000), gps5([ROW] * 4, fix, dop, 1_600_000))
    return telemetry(first, second)

"""Videos with tracks of metadata or subtitles, as cameras write them."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

_CLOCK = Fraction(1, 1000)


def write_metadata_video(
    path: Path, packets: list[tuple[float, bytes]], kind: str = "tx3g", tags: dict[str, str] | None = None
) -> Path:
    """A second of black at 10 Hz beside packets (time [s], data) of a track of that kind, four letters.

    FFmpeg writes no tracks of kinds that it does not know: a track of subtitles is renamed.
    """
    options = {"movflags": "use_metadata_tags"} if tags else {}
    with av.open(str(path), "w", options=options) as container:
        container.metadata.update(tags or {})
        picture = container.add_stream("libx264", rate=10)
        picture.width, picture.height, picture.pix_fmt = 64, 48, "yuv420p"
        track = container.add_mux_stream("mov_text")
        track.time_base = _CLOCK
        for _ in range(10):
            frame = av.VideoFrame.from_ndarray(np.zeros((48, 64), np.uint8), "gray")
            container.mux(picture.encode(frame.reformat(format="yuv420p")))
        container.mux(picture.encode())
        for t_s, data in packets:
            packet = av.Packet(data)
            packet.stream, packet.time_base = track, _CLOCK
            packet.pts = packet.dts = round(1000 * t_s)
            packet.duration = 100
            container.mux(packet)
    if kind != "tx3g":
        written = path.read_bytes()
        assert written.count(b"tx3g") == written.count(b"sbtl") == 1
        path.write_bytes(written.replace(b"tx3g", kind.encode()).replace(b"sbtl", b"meta"))
    return path


def box(name: str | bytes, content: bytes) -> bytes:
    name = name.encode("latin-1") if isinstance(name, str) else name
    return struct.pack(">I4s", 8 + len(content), name) + content


def with_box(file: Path, *names: str | bytes, content: bytes) -> Path:
    """Append a box inside boxes of other names to a video; FFmpeg skips a second ``moov``."""
    for name in reversed(names):
        content = box(name, content)
    file.write_bytes(file.read_bytes() + content)
    return file


def write_timed_metadata_video(
    path: Path, packets: list[tuple[float, bytes]], keys: dict[str, bytes]
) -> Path:
    """Write a video with a track of QuickTime's timed metadata, whose packets hold boxes named by numbers.

    Args:
        path: The file.
        packets: Time [s] and data.
        keys: The number, of four bytes, by the key's name.
    """
    table = b"".join(box(number, box("keyd", b"mdta" + name.encode())) for name, number in keys.items())
    entry = box("mebx", bytes(6) + b"\0\1" + box("keys", table))
    write_metadata_video(path, packets, "mebx")
    path.write_bytes(_with_description(path.read_bytes(), entry))
    return path


def _with_description(content: bytes, entry: bytes) -> bytes:
    """Replace the sample description of that kind; the tables of where samples are lie behind them all."""
    found, at = b"", 0
    while at < len(content):
        size, name = struct.unpack_from(">I4s", content, at)
        inner = content[at + 8 : at + size]
        if name in {b"moov", b"trak", b"mdia", b"minf", b"stbl"}:
            inner = _with_description(inner, entry)
        elif name == b"stsd" and inner[12:16] == entry[4:8]:
            inner = inner[:8] + entry
        found, at = found + box(name, inner), at + size
    return found


def subtitle_packet(text: str) -> bytes:
    return len(text.encode()).to_bytes(2, "big") + text.encode()

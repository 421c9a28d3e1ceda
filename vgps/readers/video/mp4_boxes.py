"""Boxes of an MP4 or MOV file that FFmpeg does not hand out: settings, QuickTime's tags, kinds of tracks.

Format: ISO/IEC 14496-12, and the metadata atoms of the QuickTime File Format, where ``meta`` holds names
(``keys``) and values (``ilst``).
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_SIZE = struct.Struct(">I4s")
_MOST_BYTES = 1 << 20  # of a box that is read whole
_FLOATS = {23: ">f", 24: ">d"}


def read_box(path: Path, *names: str) -> bytes | None:
    """Return the content of the first box of that path, as ``moov``, ``udta``, ``GPMF``; None without one."""
    return next(read_boxes(path, *names), None)


def read_boxes(path: Path, *names: str) -> Iterator[bytes]:
    """Yield the contents of all boxes of that path."""
    with path.open("rb") as stream:
        stream.seek(0, 2)
        yield from _contents(stream, 0, stream.tell(), names)


def quicktime_tags(path: Path) -> dict[str, str | float]:
    """Return QuickTime's tags of the file and of its tracks by name, without ``com.apple.quicktime.``."""
    tags: dict[str, str | float] = {}
    with path.open("rb") as stream:
        stream.seek(0, 2)
        end = stream.tell()
        for names in (("moov", "meta"), ("moov", "trak", "meta")):
            for content in _contents(stream, 0, end, names):
                tags = {**_tags(content), **tags}
    return tags


def track_kinds(path: Path) -> dict[int, str]:
    """Return the kind of each track by its number: the four letters of its sample description."""
    return {
        number: entry[4:8].decode("latin-1")
        for number, entry in sample_descriptions(path).items()
        if len(entry) >= _SIZE.size
    }


def sample_descriptions(path: Path) -> dict[int, bytes]:
    """Return the first sample description of each track by its number, with size and kind."""
    found: dict[int, bytes] = {}
    with path.open("rb") as stream:
        stream.seek(0, 2)
        for _, first, last in _children(stream, 0, stream.tell(), "moov", "trak"):
            header = next(_contents(stream, first, last, ("tkhd",)), b"")
            entries = next(_contents(stream, first, last, ("mdia", "minf", "stbl", "stsd")), b"")
            at = 20 if header[:1] == b"\1" else 12  # behind two times of 64 or of 32 bits
            if len(header) >= at + 4:
                found[int.from_bytes(header[at : at + 4], "big")] = entries[8:]
    return found


def inner_boxes(content: bytes, start: int = 0) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of each box in bytes, from a place on; what does not fit ends them."""
    for name, first, last in _inner(content, start):
        yield name, content[first:last]


def _contents(stream: BinaryIO, start: int, end: int, names: tuple[str, ...]) -> Iterator[bytes]:
    """Yield the contents of all boxes of a path between two places."""
    for _, first, last in _children(stream, start, end, *names):
        if last - first <= _MOST_BYTES:
            stream.seek(first)
            yield stream.read(last - first)


def _children(stream: BinaryIO, start: int, end: int, *names: str) -> Iterator[tuple[str, int, int]]:
    """Yield name, first and last place of the content of all boxes of a path between two places."""
    for name, first, last in _boxes(stream, start, end):
        if name == names[0] and len(names) > 1:
            yield from _children(stream, first, last, *names[1:])
        elif name == names[0]:
            yield name, first, last


def _boxes(stream: BinaryIO, start: int, end: int) -> Iterator[tuple[str, int, int]]:
    """Yield name, first and last place of the content of each box between two places."""
    while start + _SIZE.size <= end:
        stream.seek(start)
        head = stream.read(16)
        if len(head) < _SIZE.size:
            return
        size, name = _SIZE.unpack_from(head)
        first = start + _SIZE.size
        if size == 1 and len(head) == 16:
            size, first = struct.unpack_from(">Q", head, 8)[0], start + 16
        last = end if size == 0 else start + size
        if last < first or last > end:
            return
        yield name.decode("latin-1"), first, last
        start = last


def _tags(content: bytes) -> dict[str, str | float]:
    """Return the names and values of a ``meta`` atom; the box of that name begins with a version instead."""
    parts: dict[str, bytes] = {}
    for offset in (0, 4):
        parts = {name: content[first:last] for name, first, last in _inner(content, offset)}
        if {"keys", "ilst"} <= parts.keys():
            break
    else:
        return {}
    keys = [parts["keys"][first:last] for _, first, last in _inner(parts["keys"], 8)]
    tags: dict[str, str | float] = {}
    for index, first, last in _inner(parts["ilst"], 0):
        number = int.from_bytes(index.encode("latin-1"), "big")
        value = parts["ilst"][first + 16 : last]  # after size, "data", type and locale
        kind = int.from_bytes(parts["ilst"][first + 8 : first + 12], "big")
        if 1 <= number <= len(keys) and (read := _value(value, kind)) is not None:
            tags[keys[number - 1].decode("utf-8", "replace").removeprefix("com.apple.quicktime.")] = read
    return tags


def _inner(content: bytes, start: int) -> Iterator[tuple[str, int, int]]:
    while start + _SIZE.size <= len(content):
        size, name = _SIZE.unpack_from(content, start)
        if size < _SIZE.size or start + size > len(content):
            return
        yield name.decode("latin-1"), start + _SIZE.size, start + size
        start += size


def _value(data: bytes, kind: int) -> str | float | None:
    if kind == 1:
        return data.decode("utf-8", "replace").strip("\0 ")
    if kind in {21, 22}:
        return float(int.from_bytes(data, "big", signed=kind == 21))
    if kind in _FLOATS and len(data) == struct.calcsize(_FLOATS[kind]):
        return float(struct.unpack(_FLOATS[kind], data)[0])
    return None

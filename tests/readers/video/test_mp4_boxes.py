"""Boxes of an MP4 file: made ones, and damaged ones."""

import struct
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.readers.video.mp4_boxes import quicktime_tags, read_box


def box(name: bytes, *content: bytes) -> bytes:
    data = b"".join(content)
    return struct.pack(">I4s", 8 + len(data), name) + data


def tagged(key: bytes, kind: int, value: bytes, head: bytes = b"") -> bytes:
    """A ``meta`` box with one name and value."""
    keys = box(b"keys", struct.pack(">II", 0, 1), box(b"mdta", key))
    item = box(struct.pack(">I", 1), box(b"data", struct.pack(">II", kind, 0), value))
    return box(b"meta", head, box(b"hdlr", bytes(24)), keys, box(b"ilst", item))


FILE = box(b"ftyp", b"qt  ") + box(
    b"moov",
    box(b"mvhd", bytes(100)),
    tagged(b"com.apple.quicktime.model", 1, b"iPhone 13"),
    box(b"trak", tagged(b"com.apple.quicktime.camera.focal_length.35mm_equivalent", 22, b"\0\x1a", bytes(4))),
    box(b"udta", box(b"GPMF", b"settings")),
)


def test_boxes_and_tags_of_a_file_and_its_tracks(tmp_path):
    file = tmp_path / "phone.mov"
    file.write_bytes(FILE)
    assert read_box(file, "moov", "udta", "GPMF") == b"settings"
    assert read_box(file, "moov", "udta", "LENS") is None
    assert quicktime_tags(file) == {"model": "iPhone 13", "camera.focal_length.35mm_equivalent": 26.0}


def test_numbers_of_every_kind(tmp_path):
    file = tmp_path / "phone.mov"
    for kind, value, expected in ((21, b"\xff", -1.0), (23, struct.pack(">f", 1.5), 1.5), (99, b"x", None)):
        file.write_bytes(box(b"moov", tagged(b"key", kind, value)))
        assert quicktime_tags(file).get("key") == expected


def test_a_large_box_has_its_size_behind_its_name(tmp_path):
    file = tmp_path / "large.mp4"
    inner = box(b"udta", box(b"GPMF", b"settings"))
    file.write_bytes(struct.pack(">I4sQ", 1, b"moov", 16 + len(inner)) + inner)
    assert read_box(file, "moov", "udta", "GPMF") == b"settings"


@pytest.mark.slow
@given(place=st.integers(0, len(FILE) - 1), byte=st.integers(0, 255), end=st.integers(0, len(FILE)))
def test_damage_never_raises(place, byte, end):
    damaged = bytearray(FILE[:end])
    if place < len(damaged):
        damaged[place] = byte
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "phone.mov"
        file.write_bytes(damaged)
        read_box(file, "moov", "udta", "GPMF")
        quicktime_tags(file)

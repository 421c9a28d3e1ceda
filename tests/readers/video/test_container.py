"""A file is opened as what it is: no playlist, no picture that fills the memory."""

import struct
import zlib

import av
import pytest
from clips import write_clip

from vgps.errors import VideoError
from vgps.readers.video.container import open_container
from vgps.readers.video.images import ImageFolder
from vgps.readers.video.video_file import VideoFile


def png(width, height):
    """The header of a picture without its pixels."""

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


def test_a_playlist_does_not_open_what_it_lists(tmp_path):
    write_clip(tmp_path / "other.mp4")
    (tmp_path / "video.mp4").write_text("ffconcat version 1.0\nfile other.mp4\n")
    with av.open(str(tmp_path / "video.mp4")) as container:  # what FFmpeg does if it may
        assert container.format.name == "concat"
    with pytest.raises(VideoError, match="cannot be read as a video"):
        VideoFile(tmp_path / "video.mp4")


def test_a_name_is_not_an_address(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_clip(tmp_path / "a.mp4").rename(tmp_path / "concat:a.mp4")
    with open_container("concat:a.mp4") as container:
        assert container.format.name.startswith("mov")


def test_a_picture_of_a_hundred_megapixels_is_refused(tmp_path):
    (tmp_path / "0.png").write_bytes(png(10_000, 10_000))
    (tmp_path / "frame_times.csv").write_text("frame,t_s\n0,0\n")
    with pytest.raises(VideoError, match="a picture of 10000 x 10000; expected at most 64 megapixels"):
        ImageFolder(tmp_path)

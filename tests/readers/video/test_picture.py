"""Decoded pictures: upright, of eight bits, from a thread that ends with its reader."""

import struct
import threading

import av
import cv2
import numpy as np
import pytest
from clips import checked_frames, limited, picture, shade, write_clip

from vgps.errors import VideoError
from vgps.readers.video.picture import luma
from vgps.readers.video.video_file import VideoFile


@pytest.mark.parametrize("rotation", [90, 180, -90])
def test_the_rotation_flag_is_applied(tmp_path, rotation):
    path = write_clip(tmp_path / "v.mp4", rotation=rotation)
    video = VideoFile(path)
    assert (video.width, video.height) == ((64, 48) if rotation == 180 else (48, 64))
    gray = checked_frames(video)[0].gray
    _, shown = cv2.VideoCapture(str(path)).read()  # turns the picture by the flag itself
    np.testing.assert_allclose(gray > 128, shown[..., 0] > 128)


@pytest.mark.parametrize(
    ("codec", "pix_fmt", "expected"),
    [
        ("libx265", "yuv420p10le", limited(shade(0))),
        ("libx264", "yuv422p10le", limited(shade(0))),
        ("ffv1", "yuv420p16le", limited(shade(0))),
        ("ffv1", "bgr0", shade(0)),
        ("ffv1", "gray", shade(0)),
        ("ffv1", "gray16le", shade(0)),
        ("libx264", "nv12", limited(shade(0))),
    ],
)
def test_every_pixel_format_gives_eight_bit_luminance(tmp_path, codec, pix_fmt, expected):
    video = VideoFile(write_clip(tmp_path / "v.mkv", codec=codec, pix_fmt=pix_fmt))
    gray = checked_frames(video)[0].gray
    assert gray.dtype == np.uint8
    assert gray.flags.c_contiguous
    assert abs(int(gray[40, 40]) - expected) <= 2
    assert gray[4, 4] >= 233


def test_padded_rows_are_cut(tmp_path):
    def draw(index: int) -> np.ndarray:
        return picture(index, width=70, height=50)

    video = VideoFile(write_clip(tmp_path / "v.mp4", draw=draw, frames=2))
    gray = checked_frames(video)[0].gray
    assert gray.shape == (50, 70)
    np.testing.assert_allclose(gray[20:, :], limited(shade(0)), atol=3)


def test_big_endian_and_high_aligned_formats():
    values = np.arange(64 * 48, dtype=np.uint16).reshape(48, 64) * 21
    big = av.VideoFrame.from_ndarray(values, "gray16be")
    np.testing.assert_array_equal(luma(big), (values >> 8).astype(np.uint8))
    flat = av.VideoFrame.from_ndarray(picture(3), "rgb24").reformat(format="p010le")
    assert abs(int(luma(flat)[40, 40]) - shade(3)) <= 16  # converted, range included


@pytest.mark.slow
def test_an_abandoned_pass_ends_its_thread(tmp_path):
    video = VideoFile(write_clip(tmp_path / "v.mp4", frames=200))
    before = threading.active_count()
    frames = video.frames()
    next(frames)
    assert threading.active_count() == before + 1
    frames.close()
    assert threading.active_count() == before
    unread = video.frames()
    del unread
    assert threading.active_count() == before
    assert len(list(video.frames())) == 200


def test_an_error_in_the_decoder_thread_reaches_the_reader(tmp_path):
    path = write_clip(tmp_path / "v.mp4")
    video = VideoFile(path)
    path.unlink()
    with pytest.raises(VideoError):
        list(video.frames())


def with_display_matrix(path, out, rows):
    """Write a copy of an MP4 with another display matrix, rows of 3 numbers."""
    data = bytearray(path.read_bytes())
    header = data.find(b"tkhd")
    place = header + 4 + (52 if data[header + 4] == 1 else 40)
    scales = (1 << 16, 1 << 16, 1 << 30)
    numbers = [round(x * scale) for row in rows for x, scale in zip(row, scales, strict=True)]
    data[place : place + 36] = struct.pack(">9i", *numbers)
    out.write_bytes(data)
    return out


@pytest.mark.parametrize(
    ("rows", "found"),
    [
        ([(-1, 0, 0), (0, 1, 0), (64, 0, 1)], "mirrors the picture"),
        ([(1, 0, 0), (0, -1, 0), (0, 48, 1)], "mirrors the picture"),
        ([(0.866, 0.5, 0), (-0.5, 0.866, 0), (0, 0, 1)], "turns the picture by -30 degrees"),
    ],
)
def test_what_is_not_upright_after_quarter_turns_is_refused(tmp_path, rows, found):
    clip = write_clip(tmp_path / "clip.mp4", rotation=90)
    assert VideoFile(clip).width == 48
    with pytest.raises(VideoError, match=f"{found}; expected none, or one of quarter turns; encode it again"):
        VideoFile(with_display_matrix(clip, tmp_path / "other.mp4", rows))
    half_turn = [(-1, 0, 0), (0, -1, 0), (64, 48, 1)]
    half = VideoFile(with_display_matrix(clip, tmp_path / "half.mp4", half_turn))
    assert half.width == 64 and half.quarter_turns == 2 and VideoFile(clip).quarter_turns == 1

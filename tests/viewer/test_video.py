"""The video in the recording."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
import rerun as rr
from reading_back import Logged

from vgps.readers.video.video_file import VideoFile
from vgps.viewer.run_stream import RunStream
from vgps.viewer.video import _picture_of_frame, log_video

FRAMES = 12


def write_clip(path: Path, codec: str, pix_fmt: str = "yuv420p", rotation: int = 0, **more: Any) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=10, **more)
        stream.width, stream.height, stream.pix_fmt = 64, 48, pix_fmt
        if rotation:
            stream.set_display_rotation(rotation)
        for index in range(FRAMES):
            picture = np.full((48, 64, 3), 20 + 10 * index, np.uint8)
            frame = av.VideoFrame.from_ndarray(picture, "rgb24").reformat(format=pix_fmt)
            frame.pts, frame.time_base = index, Fraction(1, 10)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def logged(video: VideoFile, folder: Path, still_s: float | None = None) -> Logged:
    stream = rr.RecordingStream("test")
    stream.save(folder / "video.rrd")
    log_video(RunStream(stream, video.times_s), "video", video, still_s=still_s)
    stream.flush()
    stream.disconnect()
    return Logged(folder / "video.rrd")


def test_an_mp4_is_embedded_byte_for_byte(tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "clip.mp4", "libx264")
    found = logged(VideoFile(clip), tmp_path)
    ((blob,),) = found.rows("/video", "AssetVideo:blob")
    assert bytes(blob) == clip.read_bytes()
    stamps = [row[0] for row in found.rows("/video", "VideoFrameReference:timestamp")]
    assert stamps == [100_000_000 * k for k in range(FRAMES)]
    assert found.times_s("/video") == pytest.approx([k / 10 for k in range(FRAMES)])


def test_another_container_keeps_its_packets(tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "clip.mov", "libx264")
    found = logged(VideoFile(clip), tmp_path)
    ((blob,),) = found.rows("/video", "AssetVideo:blob")
    (tmp_path / "again.mp4").write_bytes(bytes(blob))
    assert len(found.rows("/video", "VideoFrameReference:timestamp")) == FRAMES
    assert packets(tmp_path / "again.mp4") == packets(clip)


def packets(path: Path) -> list[bytes]:
    with av.open(str(path)) as container:
        return [bytes(packet) for packet in container.demux(video=0) if packet.size]


@pytest.mark.parametrize(("name", "codec", "rotation"), [("a.avi", "mjpeg", 0), ("b.mp4", "libx264", 90)])
def test_what_the_viewer_cannot_show_is_embedded_as_upright_pictures(
    tmp_path: Path, name: str, codec: str, rotation: int
) -> None:
    clip = write_clip(tmp_path / name, codec, "yuvj420p" if codec == "mjpeg" else "yuv420p", rotation)
    video = VideoFile(clip)
    found = logged(video, tmp_path)
    pictures = [bytes(row[0]) for row in found.rows("/video", "EncodedImage:blob")]
    assert len(pictures) == FRAMES
    assert not found.rows("/video", "AssetVideo:blob")
    (tmp_path / "last.jpg").write_bytes(pictures[-1])
    with av.open(str(tmp_path / "last.jpg")) as picture:
        frame = next(picture.decode(video=0))
    assert (frame.width, frame.height) == (video.width, video.height)
    last = list(video.frames())[-1].gray
    assert np.median(frame.to_ndarray(format="gray")) == pytest.approx(np.median(last), abs=3)


@pytest.mark.parametrize("ffmpeg", [None, "/usr/bin/ffmpeg"])
def test_a_still_is_decoded_here_if_the_viewer_lacks_ffmpeg(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ffmpeg: str | None
) -> None:
    monkeypatch.setattr("vgps.viewer.video.shutil.which", lambda name: ffmpeg)
    video = VideoFile(write_clip(tmp_path / "clip.mp4", "libx264"))
    found = logged(video, tmp_path, still_s=0.55)
    assert len(found.rows("/video", "AssetVideo:blob")) == (1 if ffmpeg else 0)
    stills = found.rows("/video", "EncodedImage:blob")
    assert len(stills) == (0 if ffmpeg else 1)
    for ((blob),) in stills:
        gray = cv2.imdecode(np.asarray(blob, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert np.median(gray) == pytest.approx(np.median(list(video.frames())[5].gray), abs=3)


def test_each_frame_gets_its_picture() -> None:
    stamps = np.array([0, 100, 200, 300]) * 1_000_000
    np.testing.assert_array_equal(_picture_of_frame(np.array([0.0, 0.11, 0.19, 0.3]), stamps), [0, 1, 2, 3])
    np.testing.assert_array_equal(_picture_of_frame(np.array([0.0, 0.19, 0.31]), stamps), [0, 2, 3])
    np.testing.assert_array_equal(_picture_of_frame(np.array([0.0, 0.5]), stamps[:1]), [0, 0])


def test_a_video_whose_first_picture_is_damaged_is_shown_from_the_next_on(tmp_path: Path) -> None:
    """Its own MP4 would not play; the reader tolerates the damage."""
    clip = write_clip(tmp_path / "clip.mp4", "libx264", options={"g": "1", "bf": "0"})
    with av.open(str(clip)) as container:
        first = next(packet for packet in container.demux(video=0) if packet.size)
        at, size = first.pos, first.size
    data = bytearray(clip.read_bytes())
    data[at : at + size] = b"\xff" * size
    clip.write_bytes(bytes(data))
    video = VideoFile(clip)
    with pytest.raises(av.FFmpegError), av.open(str(clip)) as container:
        next(container.decode(video=0))
    assert len(logged(video, tmp_path).rows("/video", "EncodedImage:blob")) == FRAMES

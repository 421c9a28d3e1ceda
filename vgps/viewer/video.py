"""The video in the recording: its own packets where the viewer can decode them, else small grey pictures."""

import io
import shutil
from pathlib import Path

import av
import cv2
import numpy as np
import rerun as rr

from vgps.model import FloatArray, IntArray, Video
from vgps.readers.luma import quarter_turns
from vgps.readers.video import VideoFile
from vgps.viewer.columns import Sheet

_CODECS = frozenset({"h264", "hevc", "av1"})
_NEEDS_FFMPEG = frozenset({"h264", "hevc"})
_PICTURES_AT_ONCE = 100
_JPEG_QUALITY = 80


def log_video(sheet: Sheet, path: str, video: Video) -> tuple[str, ...]:
    """Show the video at ``path``, one picture per frame.

    A file that holds H.264, HEVC or AV1 goes in without being encoded again, in its own MP4 or with its
    packets put into one. What the viewer cannot show as it is (another codec, a rotation flag, damage, a
    folder of images) is decoded, and its luminance goes in as JPEG.

    Returns:
        What a user should know, a line each.

    Raises:
        VideoError: A picture of another size.
    """
    packed = _mp4(video.path) if isinstance(video, VideoFile) else None
    if packed is None:
        _log_pictures(sheet, path, video)
        return ()
    contents, codec = packed
    asset = rr.AssetVideo(contents=contents, media_type="video/mp4")
    try:
        stamps = np.asarray(asset.read_frame_timestamps_nanos())
    except RuntimeError:  # a damaged or unusual file, which FFmpeg reads and the viewer does not
        stamps = np.zeros(0, np.int64)
    if not len(stamps):
        _log_pictures(sheet, path, video)
        return ()
    sheet.static(path, asset)
    chosen = stamps[_frame_of(sheet.t_s, stamps)]
    sheet.at_frames(
        path,
        rr.VideoFrameReference.columns(
            timestamp=[rr.components.VideoTimestamp(nanoseconds=t) for t in chosen]
        ),
    )
    if codec in _NEEDS_FFMPEG and shutil.which("ffmpeg") is None:
        return (f"the viewer needs ffmpeg to show {codec} video: install it (apt install ffmpeg)",)
    return ()


def _frame_of(t_s: FloatArray, stamps_ns: IntArray) -> IntArray:
    """(F,) the picture of each frame: one to one where there are as many, else the nearest in time."""
    if len(stamps_ns) == len(t_s):
        return np.arange(len(t_s))
    of_picture = (stamps_ns - stamps_ns[0]) * 1e-9
    after = np.clip(np.searchsorted(of_picture, t_s), 1, max(1, len(of_picture) - 1))
    after = np.minimum(after, len(of_picture) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(t_s - of_picture[before] <= of_picture[after] - t_s, before, after)


def _mp4(file: Path) -> tuple[bytes, str] | None:
    """The bytes of an MP4 with the file's video and its codec; None if the viewer cannot show it."""
    try:
        with av.open(str(file)) as container:
            stream = container.streams.video[0]
            codec = stream.codec_context.name
            codec = {"libdav1d": "av1", "libaom-av1": "av1"}.get(codec, codec)
            picture = next(container.decode(stream), None)
            if codec not in _CODECS or picture is None or quarter_turns(picture):
                return None
        contents = file.read_bytes() if file.suffix.lower() in {".mp4", ".m4v"} else _repacked(file)
    except av.FFmpegError:  # damage that the project's own reader gets over
        return None
    return contents, codec


def _repacked(file: Path) -> bytes:
    """The same packets in an MP4, nothing encoded."""
    out = io.BytesIO()
    with av.open(str(file)) as source, av.open(out, "w", format="mp4") as target:
        stream = source.streams.video[0]
        copy = target.add_stream_from_template(stream)
        for packet in source.demux(stream):
            if packet.size and packet.dts is not None:
                packet.stream = copy
                target.mux(packet)
    return out.getvalue()


def _log_pictures(sheet: Sheet, path: str, video: Video) -> None:
    """Every frame as a grey JPEG."""
    waiting: list[bytes] = []
    t_s: list[float] = []

    def send() -> None:
        columns = rr.EncodedImage.columns(blob=waiting, media_type=["image/jpeg"] * len(waiting))
        sheet.at_times(path, np.array(t_s), columns)
        waiting.clear()
        t_s.clear()

    for frame in video.frames():
        if frame.index >= len(sheet.t_s):
            break
        _, jpeg = cv2.imencode(".jpg", frame.gray, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        waiting.append(jpeg.tobytes())
        t_s.append(float(sheet.t_s[frame.index]))
        if len(waiting) == _PICTURES_AT_ONCE:
            send()
    if waiting:
        send()

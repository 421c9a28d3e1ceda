"""The video in a rerun recording: its own packets if the viewer decodes them, otherwise grey JPEGs."""

import io
import shutil
from pathlib import Path

import av
import cv2
import numpy as np
import rerun as rr

from vgps.model import FloatArray, Frame, IntArray, Video
from vgps.readers.video.container import open_container
from vgps.readers.video.picture import quarter_turns
from vgps.readers.video.video_file import VideoFile
from vgps.viewer.run_stream import RunStream

_CODECS = frozenset({"h264", "hevc", "av1"})
_NEEDS_FFMPEG = frozenset({"h264", "hevc"})
_CHUNK_FRAMES = 100
_JPEG_QUALITY = 80


def log_video(stream: RunStream, path: str, video: Video, *, still_s: float | None = None) -> tuple[str, ...]:
    """Log the video at an entity path, one picture per frame.

    H.264, HEVC and AV1 are not encoded again: the MP4 is embedded, packets of other containers are remuxed
    into one. What the viewer cannot show (another codec, a rotation flag, damage, a folder of images) is
    decoded and its luminance embedded as JPEG.

    Args:
        stream: Where to.
        path: The entity.
        video: The video.
        still_s: Only the frame at this time is needed; it is decoded here if the viewer lacks ffmpeg.

    Returns:
        Notes for the user, a line each.

    Raises:
        VideoError: A picture has another size than the first.
    """
    remuxed = _mp4(video.path) if isinstance(video, VideoFile) else None
    if remuxed is None:
        _log_pictures(stream, path, video)
        return ()
    contents, codec = remuxed
    without_ffmpeg = codec in _NEEDS_FFMPEG and shutil.which("ffmpeg") is None
    if without_ffmpeg and still_s is not None:
        _log_still(stream, path, video, still_s)
        return ()
    asset = rr.AssetVideo(contents=contents, media_type="video/mp4")
    try:
        stamps = np.asarray(asset.read_frame_timestamps_nanos())
    except RuntimeError:  # a damaged or unusual file that FFmpeg reads and the viewer does not
        stamps = np.zeros(0, np.int64)
    if not len(stamps):
        _log_pictures(stream, path, video)
        return ()
    stream.log_static(path, asset)
    chosen = stamps[_picture_of_frame(stream.t_s, stamps)]
    stream.send_frames(
        path,
        rr.VideoFrameReference.columns(
            timestamp=[rr.components.VideoTimestamp(nanoseconds=t) for t in chosen]
        ),
    )
    if without_ffmpeg:
        return (f"the viewer needs ffmpeg to show {codec} video: install it (apt install ffmpeg)",)
    return ()


def _picture_of_frame(t_s: FloatArray, stamps_ns: IntArray) -> IntArray:
    """Return (F,) the picture of each frame: one to one if there are as many, otherwise the nearest."""
    if len(stamps_ns) == len(t_s):
        return np.arange(len(t_s))
    picture_s = (stamps_ns - stamps_ns[0]) * 1e-9
    after = np.clip(np.searchsorted(picture_s, t_s), 1, max(1, len(picture_s) - 1))
    after = np.minimum(after, len(picture_s) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(t_s - picture_s[before] <= picture_s[after] - t_s, before, after)


def _mp4(file: Path) -> tuple[bytes, str] | None:
    """Return the video as the bytes of an MP4, and its codec; None if the viewer cannot show it."""
    try:
        with open_container(file) as container:
            stream = container.streams.video[0]
            codec = stream.codec_context.name
            codec = {"libdav1d": "av1", "libaom-av1": "av1"}.get(codec, codec)
            picture = next(container.decode(stream), None)
            if codec not in _CODECS or picture is None or quarter_turns(picture):
                return None
        contents = file.read_bytes() if file.suffix.lower() in {".mp4", ".m4v"} else _remux(file)
    except av.FFmpegError:  # damage that vgps.readers.video.video_file tolerates
        return None
    return contents, codec


def _remux(file: Path) -> bytes:
    """Return the same packets in an MP4."""
    out = io.BytesIO()
    with open_container(file) as source, av.open(out, "w", format="mp4") as target:
        stream = source.streams.video[0]
        copy = target.add_stream_from_template(stream)
        for packet in source.demux(stream):
            if packet.size and packet.dts is not None:
                packet.stream = copy
                target.mux(packet)
    return out.getvalue()


def _log_pictures(stream: RunStream, path: str, video: Video) -> None:
    """Log every frame as a grey JPEG."""
    jpegs: list[bytes] = []
    t_s: list[float] = []

    def send() -> None:
        columns = rr.EncodedImage.columns(blob=jpegs, media_type=["image/jpeg"] * len(jpegs))
        stream.send_times(path, np.array(t_s), columns)
        jpegs.clear()
        t_s.clear()

    for frame in video.frames():
        if frame.index >= len(stream.t_s):
            break
        jpegs.append(_jpeg(frame))
        t_s.append(float(stream.t_s[frame.index]))
        if len(jpegs) == _CHUNK_FRAMES:
            send()
    if jpegs:
        send()


def _log_still(stream: RunStream, path: str, video: Video, t_s: float) -> None:
    """Log the frame at a time as a grey JPEG."""
    index = max(0, int(np.searchsorted(stream.t_s, t_s, side="right")) - 1)
    for frame in video.frames():
        if frame.index == index:
            stream.log_static(path, rr.EncodedImage(contents=_jpeg(frame), media_type="image/jpeg"))
            return


def _jpeg(frame: Frame) -> bytes:
    _, jpeg = cv2.imencode(".jpg", frame.gray, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return jpeg.tobytes()

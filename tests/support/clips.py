"""Small clips with known pixels and times."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from vgps.readers.video.video_file import VideoFile


def shade(index: int) -> int:
    """Grey value of frame ``index`` of a clip."""
    return 20 + 8 * (index % 28)


def picture(index: int, width: int = 64, height: int = 48) -> np.ndarray:
    """Uniform grey that numbers the frame, with a white block in the upper left corner."""
    image = np.full((height, width, 3), shade(index), np.uint8)
    image[:16, :16] = 255
    return image


def noise(index: int, width: int = 160, height: int = 120) -> np.ndarray:
    """Incompressible: a frame fills kilobytes, so damage hits some frames and not others."""
    return np.random.default_rng(index).integers(0, 255, (height, width, 3), dtype=np.uint8)


def write_clip(
    path: Path,
    pts: list[int] | None = None,
    *,
    frames: int = 10,
    codec: str = "libx264",
    pix_fmt: str = "yuv420p",
    rotation: int = 0,
    draw=picture,
    options: dict[str, str] | None = None,
    container_options: dict[str, str] | None = None,
) -> Path:
    """Encode a clip at 10 Hz, or at the given stamps in milliseconds."""
    size = draw(0).shape
    with av.open(str(path), "w", options=container_options or {}) as container:
        stream = container.add_stream(
            codec, rate=10, options={"x265-params": "log-level=none", **(options or {})}
        )
        stream.width, stream.height, stream.pix_fmt = size[1], size[0], pix_fmt
        if rotation:
            stream.set_display_rotation(rotation)
        if pts is not None:
            stream.codec_context.time_base = stream.time_base = Fraction(1, 1000)
        for index in range(len(pts) if pts is not None else frames):
            frame = av.VideoFrame.from_ndarray(draw(index), "rgb24").reformat(format=pix_fmt)
            if pts is not None:
                frame.pts, frame.time_base = pts[index], Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def limited(value: int) -> int:
    """Y of a grey value in video range, ITU-R BT.601."""
    return round(16 + 219 * value / 255)


def checked_frames(video: VideoFile) -> list:
    """All frames, after checking that they correspond to the times one to one."""
    frames = list(video.frames())
    assert [frame.index for frame in frames] == list(range(len(video.times_s)))
    assert [frame.t_s for frame in frames] == video.times_s.tolist()
    assert {frame.gray.shape for frame in frames} == {(video.height, video.width)}
    return frames

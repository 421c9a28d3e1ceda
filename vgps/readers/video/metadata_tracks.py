"""Tracks of a video file that hold no pictures: a camera's metadata and subtitles, packet by packet."""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import av
from av.stream import Discard

from vgps.errors import RecordingError
from vgps.readers.video.container import open_container
from vgps.readers.video.mp4_boxes import track_kinds


@dataclass(frozen=True)
class Packet:
    """A payload with its time in the container, seconds from the video's first frame."""

    data: bytes
    start_s: float
    duration_s: float


def packets_of(video: Path, *kinds: str, most: int | None = None) -> Iterator[Packet]:
    """Yield the packets of the first track of an MP4 or MOV file that is of one of these kinds.

    Args:
        video: The file.
        kinds: The four letters of a sample description, which FFmpeg does not report.
        most: Largest number of packets to read.

    Raises:
        RecordingError: The video cannot be read.
    """
    with _read_errors(video):
        numbers = {number for number, kind in track_kinds(video).items() if kind in kinds}
    if numbers:
        yield from packets(video, lambda stream: stream.id in numbers, most)


def packets(video: Path, wanted: Callable[[Any], bool], most: int | None = None) -> Iterator[Packet]:
    """Yield the packets, or the first ones, of a video's first wanted stream; none if it has no such stream.

    Raises:
        RecordingError: The video cannot be read.
    """
    with _read_errors(video), open_container(video) as container:
        streams = list(container.streams)
        track = next((stream for stream in streams if wanted(stream)), None)
        if track is None:
            return
        for stream in streams:
            if stream.index != track.index:
                stream.discard = Discard.all  # avoids reading the images from disk
        first = _first_frame_s(container)
        filled = (packet for packet in container.demux(track) if packet.size)
        for packet in islice(filled, most):
            yield Packet(
                bytes(packet),
                float((packet.pts or 0) * packet.time_base) - first,
                float((packet.duration or 0) * packet.time_base),
            )


def length_s(video: Path) -> float:
    """Return the length of a video as its file states it [s]; 0 if it does not.

    Raises:
        RecordingError: The video cannot be read.
    """
    with _read_errors(video), open_container(video) as container:
        return (container.duration or 0) / av.time_base


@contextlib.contextmanager
def _read_errors(video: Path) -> Iterator[None]:
    try:
        yield
    except (av.FFmpegError, OSError) as error:
        raise RecordingError(f"cannot be read ({error})", file=video) from error


def _first_frame_s(container: Any) -> float:
    """Return the container's time of the first frame, which an edit list may shift from zero."""
    stream = next(iter(container.streams.video), None)
    if stream is None or stream.start_time is None:
        return 0.0
    return float(stream.start_time * stream.time_base)

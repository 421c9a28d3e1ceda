"""Tracks of a video file that hold no pictures: a camera's metadata and subtitles, packet by packet."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
from av.stream import Discard

from vgps.errors import RecordingError
from vgps.readers.container import open_container
from vgps.readers.mp4_boxes import track_kinds


@dataclass(frozen=True)
class Packet:
    """A payload with its time in the container, seconds from the video's first frame."""

    data: bytes
    start_s: float
    duration_s: float


def packets(video: Path, wanted: Callable[[Any, str], bool]) -> list[Packet]:
    """Return the packets of a video's first track of a kind in order; none if it has no such track.

    Args:
        video: The file.
        wanted: Whether a stream of PyAV's is of that kind; the four letters of its sample description in an
            MP4 or MOV file, else nothing, tell what FFmpeg does not.

    Raises:
        RecordingError: The video cannot be read.
    """
    try:
        kinds = track_kinds(video)
        with open_container(video) as container:
            streams = list(container.streams)
            track = next((one for one in streams if wanted(one, kinds.get(one.id, ""))), None)
            if track is None:
                return []
            for stream in streams:
                if stream.index != track.index:
                    stream.discard = Discard.all  # avoids reading the images from disk
            first = _first_frame_s(container)
            return [
                Packet(
                    bytes(packet),
                    float((packet.pts or 0) * packet.time_base) - first,
                    float((packet.duration or 0) * packet.time_base),
                )
                for packet in container.demux(track)
                if packet.size
            ]
    except (av.FFmpegError, OSError) as error:
        raise RecordingError(f"cannot be read ({error})", file=video) from error


def _first_frame_s(container: Any) -> float:
    """Return the container's time of the first frame, which an edit list may shift from zero."""
    stream = next(iter(container.streams.video), None)
    if stream is None or stream.start_time is None:
        return 0.0
    return float(stream.start_time * stream.time_base)

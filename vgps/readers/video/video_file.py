"""Video files: exact presentation times, and the luminance of exactly one frame per time."""

import contextlib
import logging
from collections.abc import Collection, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from vgps.errors import VideoError
from vgps.model import FloatArray, Frame, RgbImage
from vgps.readers.video.container import check_size, open_container
from vgps.readers.video.frame_times import FrameTimes, read_frame_times
from vgps.readers.video.picture import check_upright, colours, luma, quarter_turns, upright_size
from vgps.runtime.threads import run_ahead

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Slots:
    """The times of the frames and which packets hold them.

    Attributes:
        t_s: (F,) times since the first frame.
        index: Frame of each presentation stamp; None if frames follow from the decoder's order.
        packets: Number of packets that hold these frames; what follows is damaged.
        cut: Whether the file declares more frames than it has.
    """

    t_s: FloatArray
    index: dict[int, int] | None
    packets: int
    cut: bool


class VideoFile:
    """The frames of a video, each with its own presentation time.

    Times are the packets' presentation stamps (B-frames reordered, variable rates kept), seconds since the
    first frame; a ``frame_times.csv`` overrides them. ``frames()`` yields exactly one frame per time; one
    that cannot be decoded is black, with an entry in ``warnings`` and in the log.
    """

    def __init__(self, path: str | Path, frame_times: str | Path | None = None) -> None:
        """Index the file, decoding only its first frame.

        Raises:
            VideoError: The file is missing, not a video, has no frames, or not as many as ``frame_times``, or
                its display matrix mirrors the picture.
        """
        self.path = Path(path)
        self._warnings: tuple[str, ...] = ()
        self._stamp = _stamp(self.path)
        times = read_frame_times(Path(frame_times)) if frame_times is not None else None
        if not self.path.is_file():
            raise VideoError("no such video", file=self.path)
        with _video_errors(self.path), open_container(self.path) as container:
            self._slots = _slots(container, self.path, times)
        with contextlib.closing(self._pictures()) as pictures:
            first = next(pictures, None)
        if first is None:
            raise VideoError("no frame can be decoded", file=self.path, expected="a video with frames")
        check_upright(first, self.path)
        self.width, self.height = upright_size(first)
        self.quarter_turns = quarter_turns(first)
        self.start_s = float(times.t_s[0]) if times is not None else 0.0

    @property
    def times_s(self) -> FloatArray:
        """(F,) presentation times, seconds since the first frame, strictly increasing."""
        return self._slots.t_s

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the last complete pass over the frames could not decode, as sentences."""
        return self._warnings

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order of presentation, decoded ahead in a separate thread.

        Raises:
            VideoError: The image size changes within the video.
        """
        return run_ahead(self._frames)

    def pictures(self, wanted: Collection[int]) -> Iterator[tuple[int, RgbImage]]:
        """Yield index and colours of some frames in order; those that cannot be decoded are left out."""
        last = max(wanted, default=-1)
        for count, picture in enumerate(self._pictures()):
            index = count if self._slots.index is None else self._slots.index.get(picture.pts or 0)
            if index is not None and index in wanted:
                yield index, colours(picture)
            if index is not None and index >= last:
                return

    def _frames(self) -> Generator[Frame]:
        t_s, following, lost, doubtful, extra = self.times_s, 0, list[int](), list[int](), 0
        black = np.zeros((self.height, self.width), np.uint8)
        for count, picture in enumerate(self._pictures()):
            index = count if self._slots.index is None else self._slots.index.get(picture.pts or 0)
            if index is None or not following <= index < len(t_s):
                extra += 1
                continue
            if upright_size(picture) != (self.width, self.height):
                raise VideoError(
                    f"an image of {upright_size(picture)}",
                    file=self.path,
                    place=f"frame {index}",
                    expected=f"{self.width} x {self.height} as at the start",
                )
            lost.extend(range(following, index))
            yield from (Frame(missing, float(t_s[missing]), black) for missing in range(following, index))
            if picture.is_corrupt:
                doubtful.append(index)
            yield Frame(index, float(t_s[index]), luma(picture))
            following = index + 1
        lost.extend(range(following, len(t_s)))
        yield from (Frame(missing, float(t_s[missing]), black) for missing in range(following, len(t_s)))
        self._warn(lost, doubtful, extra)

    def _pictures(self) -> Generator[av.VideoFrame]:
        with _video_errors(self.path), open_container(self.path) as container:
            stream = _stream(container, self.path)
            stream.thread_type = "AUTO"
            for number, packet in enumerate(_packets(container, stream)):
                if number >= self._slots.packets:
                    break
                # a damaged packet costs only its own frame
                with contextlib.suppress(av.error.FFmpegError):
                    yield from stream.codec_context.decode(packet)
            with contextlib.suppress(av.error.FFmpegError):
                yield from stream.codec_context.decode(None)

    def _warn(self, lost: list[int], doubtful: list[int], extra: int) -> None:
        notes = []
        if self._slots.cut:
            notes.append(f"the file is truncated after {len(self.times_s)} frames")
        if lost:
            why = "" if _stamp(self.path) == self._stamp else ": the file changed while it was read"
            notes.append(
                f"{len(lost)} of {len(self.times_s)} frames cannot be decoded, first frame {lost[0]}{why}"
            )
        if doubtful:
            notes.append(f"{len(doubtful)} frames are damaged, first frame {doubtful[0]}")
        if extra:
            notes.append(f"{extra} decoded images without a time of their own were skipped")
        self._warnings = tuple(notes)
        for note in notes:
            log.warning("%s: %s", self.path, note)


def _stamp(path: Path) -> tuple[int, int] | None:
    """Return size and time of change; None if the file is gone."""
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_size, about.st_mtime_ns


@contextlib.contextmanager
def _video_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except (av.error.FFmpegError, OSError) as error:
        raise VideoError(
            f"cannot be read as a video ({error.strerror})",
            file=path,
            expected="a complete video file that FFmpeg decodes",
        ) from error


def _stream(container: av.container.InputContainer, path: Path) -> av.VideoStream:
    stream = container.streams.best("video")
    if not isinstance(stream, av.VideoStream):
        raise VideoError("no video stream", file=path, expected="a video")
    if stream.codec_context is None:
        raise VideoError("no decoder for its codec", file=path, expected="a video that FFmpeg decodes")
    check_size(stream.width, stream.height, path)
    return stream


def _packets(
    container: av.container.InputContainer, stream: av.VideoStream
) -> Iterator["av.Packet[av.VideoStream]"]:
    """Yield packets that hold a frame, without the final flush and AVI's empty repeats."""
    with contextlib.suppress(av.error.InvalidDataError, av.error.EOFError):
        yield from (packet for packet in container.demux(stream) if packet.size > 0)


def _slots(container: av.container.InputContainer, path: Path, times: FrameTimes | None) -> _Slots:
    stream = _stream(container, path)
    packets = list(_packets(container, stream))
    # a file truncated within a packet: keep the frames before
    while packets and packets[-1].is_corrupt:
        packets.pop()
    cut = stream.frames > len(packets)
    shown = [packet for packet in packets if not packet.is_discard]
    if not shown:
        raise VideoError("no frames", file=path, expected="a video with frames")
    # AVI stamps packets in decoding order: frames follow from the order of the decoder's output
    in_order = container.format.name == "avi" or any(packet.pts is None for packet in shown)
    stamps = sorted(
        {stamp for packet in shown if (stamp := packet.dts if in_order else packet.pts) is not None}
    )
    count = len(shown) if in_order else len(stamps)
    index = None if in_order else {stamp: place for place, stamp in enumerate(stamps)}
    if times is not None:
        if len(times.t_s) != count:
            raise VideoError(
                f"{len(times.t_s)} times", file=times.path, expected=f"{count}, a row for every frame"
            )
        return _Slots(times.t_s - times.t_s[0], index, len(packets), cut)
    if len(stamps) != count or stream.time_base is None:
        raise VideoError(
            "no presentation times", file=path, remedy="put a frame_times.csv (frame,t_s) beside the video"
        )
    t_s = np.array([float((stamp - stamps[0]) * stream.time_base) for stamp in stamps])
    return _Slots(t_s, index, len(packets), cut)

"""A camera, a network stream or a file through PyAV, decoded in a thread of its own."""

import contextlib
import queue
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import av

from vgps.errors import VideoError
from vgps.online.estimate import counts_as_news
from vgps.online.run import TimedImage
from vgps.readers.video.picture import luma

_QUEUED = 2  # frames; if more arrive than can be processed, older ones are dropped
_TIMEOUT_S = 10.0  # silence after which a stream is reopened
_RETRY_S = (0.2, 5.0)  # first and longest pause between two attempts
_BACKLOG_S = 3.0  # longest time for which frames buffered by the stream are skipped
_MIN_STEP_S = 1e-4  # between frames whose time stamps do not increase
# by default FFmpeg analyses a stream for five seconds first
_LOW_LATENCY = {
    "fflags": "nobuffer",
    "rtsp_transport": "tcp",
    "analyzeduration": "500000",
    "probesize": "500000",
}


class VideoSource:
    """A live source of frames; a stream that drops is reopened until the source is closed.

    Frames have the stream's time stamps, converted to this computer's clock at each connection after buffered
    frames have been skipped, or else their times of arrival.

    Args:
        address: A device (``/dev/video0``), an address that FFmpeg opens (``rtsp://``, ``http://``,
            ``tcp://``), or a file, which is read as fast as it is consumed.

    Raises:
        VideoError: The source cannot be opened.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.live = not Path(address).is_file()
        self.dropped = 0
        self.start_unix_s = 0.0
        self._shape: tuple[int, ...] = ()
        self._other_sizes = 0
        self._begun_s: float | None = None  # monotonic time of the first frame
        self._last_s = -1.0
        self._frames: queue.Queue[TimedImage] = queue.Queue(_QUEUED)
        self._notes: queue.Queue[str] = queue.Queue()
        self._closed, self._ended = threading.Event(), threading.Event()
        try:
            container = self._opened()
        except (av.error.FFmpegError, OSError) as error:
            raise VideoError(
                f"cannot be opened ({error.strerror or error})",
                file=address,
                expected="a camera, a stream or a video that FFmpeg opens",
            ) from error
        if not container.streams.video:
            raise VideoError(
                "no video in it",
                file=address,
                expected="a camera, a stream or a video that FFmpeg opens",
            )
        threading.Thread(target=self._work, args=(container,), name="video", daemon=True).start()

    def next(self, timeout_s: float) -> TimedImage | None:
        """Return the next frame, or None after the timeout."""
        with contextlib.suppress(queue.Empty):
            return self._frames.get(timeout=timeout_s)
        return None

    @property
    def ended(self) -> bool:
        """Whether there are no more frames."""
        return self._ended.is_set() and self._frames.empty()

    def notes(self) -> list[str]:
        """Return notes on the connection since the last call."""
        notes = []
        with contextlib.suppress(queue.Empty):
            while True:
                notes.append(self._notes.get_nowait())
        return notes

    def close(self) -> None:
        """Stop reading."""
        self._closed.set()

    def _opened(self) -> av.container.InputContainer:
        device = self.address.startswith("/dev/video")
        options = _LOW_LATENCY if self.live and not device else {}
        form = "v4l2" if device else None
        return av.open(self.address, format=form, options=options, timeout=_TIMEOUT_S if self.live else None)

    def _work(self, container: av.container.InputContainer) -> None:
        try:
            self._read_until_closed(container)
        finally:
            self._ended.set()

    def _read_until_closed(self, container: av.container.InputContainer) -> None:
        while True:
            with contextlib.suppress(av.error.FFmpegError, OSError, IndexError), container:
                self._read(container)
            if self._closed.is_set() or not self.live:
                break
            self._notes.put(f"{self.address}: the stream dropped; reconnecting")
            again = self._reconnected()
            if again is None:
                break
            container = again

    def _reconnected(self) -> av.container.InputContainer | None:
        wait_s = _RETRY_S[0]
        while not self._closed.wait(wait_s):
            with contextlib.suppress(av.error.FFmpegError, OSError):
                container = self._opened()
                self._notes.put(f"{self.address}: connected again")
                return container
            wait_s = min(2.0 * wait_s, _RETRY_S[1])
        return None

    def _read(self, container: av.container.InputContainer) -> None:
        for image, stamp_s, arrival_s in self._current(container):
            if self._closed.is_set():
                return
            gray = luma(image)
            self._shape = self._shape or gray.shape
            if gray.shape != self._shape:
                self._other_sizes += 1
                if counts_as_news(self._other_sizes):
                    found = f"{gray.shape[1]} x {gray.shape[0]}"
                    self._notes.put(
                        f"{self.address}: {self._other_sizes} frames of another size ({found}) left out"
                    )
                continue
            if self._begun_s is None:
                self._begun_s = stamp_s
                self.start_unix_s = time.time() - (time.monotonic() - stamp_s)
            t_s = max(stamp_s - self._begun_s, self._last_s + _MIN_STEP_S, 0.0)
            self._last_s = t_s
            self._put(TimedImage(t_s, gray, arrival_s))

    def _current(
        self, container: av.container.InputContainer
    ) -> Iterator[tuple[av.VideoFrame, float, float]]:
        """Yield frames without the stream's backlog, their times on this computer's clock, and their
        arrival."""
        offset_s, current, first_s = float("inf"), not self.live, time.monotonic()
        before_s, before_stamp_s = -float("inf"), 0.0
        for image in container.decode(video=0):
            arrival_s = time.monotonic()
            stamp_s = arrival_s if image.time is None else image.time
            if not current:
                # buffered frames arrive faster than they were taken
                offset_s = min(offset_s, arrival_s - stamp_s)
                current = arrival_s - before_s > 0.5 * (stamp_s - before_stamp_s) and before_s >= first_s
                current = current or arrival_s - first_s > _BACKLOG_S
                before_s, before_stamp_s = arrival_s, stamp_s
            if offset_s == float("inf"):
                offset_s = arrival_s - stamp_s
            if current:
                yield image, stamp_s + offset_s, arrival_s

    def _put(self, frame: TimedImage) -> None:
        while not self._closed.is_set():
            with contextlib.suppress(queue.Full):
                self._frames.put(frame, timeout=0.0 if self.live else 0.1)
                return
            if self.live:
                with contextlib.suppress(queue.Empty):
                    self._frames.get_nowait()
                    self.dropped += 1

"""A camera, a network stream or a file through PyAV, decoded in a thread of its own."""

import contextlib
import queue
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import av

from vgps.errors import VideoError
from vgps.online.run import TimedImage
from vgps.readers.luma import luma

_QUEUED = 2  # pictures; when more come than can be posed, older ones are dropped
_TIMEOUT_S = 10.0  # of a stream that has gone silent, before it is opened again
_RETRY_S = (0.2, 5.0)  # first and longest pause between two attempts
_BACKLOG_S = 3.0  # for at most so long, pictures that a stream had stored are skipped
_MIN_STEP_S = 1e-4  # between two pictures whose time stamps stand still or go back
# FFmpeg would look at a stream for five seconds first
_LOW_LATENCY = {
    "fflags": "nobuffer",
    "rtsp_transport": "tcp",
    "analyzeduration": "500000",
    "probesize": "500000",
}


class VideoSource:
    """Frames as they come. A stream that drops is opened again until the source is closed; a file ends.

    Times are the stream's own, put on this computer's clock at each connection once buffered pictures have
    been skipped; a stream without times gets those of arrival.

    Args:
        address: A device (``/dev/video0``), an address that FFmpeg opens (``rtsp://``, ``http://``,
            ``tcp://``), or a file, which is read as fast as it is consumed.

    Raises:
        VideoError: It cannot be opened the first time.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.live = not Path(address).is_file()
        self.dropped = 0
        self.start_unix_s = 0.0
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
        """Return the next frame, or nothing yet."""
        with contextlib.suppress(queue.Empty):
            return self._frames.get(timeout=timeout_s)
        return None

    @property
    def ended(self) -> bool:
        """Whether no more frame will come."""
        return self._ended.is_set() and self._frames.empty()

    def notes(self) -> list[str]:
        """Return notes on the connection since the last call."""
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._notes.get_nowait())
        return found

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
        for picture, own_s, at_s in self._current(container):
            if self._closed.is_set():
                return
            if self._begun_s is None:
                self._begun_s = own_s
                self.start_unix_s = time.time() - (time.monotonic() - own_s)
            t_s = max(own_s - self._begun_s, self._last_s + _MIN_STEP_S, 0.0)
            self._last_s = t_s
            self._put(TimedImage(t_s, luma(picture), at_s))

    def _current(
        self, container: av.container.InputContainer
    ) -> Iterator[tuple[av.VideoFrame, float, float]]:
        """Yield pictures, their times on the clock of arrival, and their arrival, without an old backlog."""
        offset_s, current, first_s = float("inf"), not self.live, time.monotonic()
        before_s, before_own_s = -float("inf"), 0.0
        for picture in container.decode(video=0):
            at_s = time.monotonic()
            own_s = at_s if picture.time is None else picture.time
            if not current:
                # buffered pictures come faster than they were taken
                offset_s = min(offset_s, at_s - own_s)
                current = at_s - before_s > 0.5 * (own_s - before_own_s) and before_s >= first_s
                current = current or at_s - first_s > _BACKLOG_S
                before_s, before_own_s = at_s, own_s
            if offset_s == float("inf"):
                offset_s = at_s - own_s
            if current:
                yield picture, own_s + offset_s, at_s

    def _put(self, frame: TimedImage) -> None:
        while not self._closed.is_set():
            with contextlib.suppress(queue.Full):
                self._frames.put(frame, timeout=0.0 if self.live else 0.1)
                return
            if self.live:
                with contextlib.suppress(queue.Empty):
                    self._frames.get_nowait()
                    self.dropped += 1

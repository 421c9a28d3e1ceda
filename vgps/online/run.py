"""The loop of the live mode: feed a smoother until its sources end or it is stopped."""

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from types import FrameType

from vgps.model import FloatArray, GrayImage
from vgps.online.estimate import OnlineEstimate
from vgps.online.smoother import OnlineSmoother
from vgps.readers.gps_formats.fixes import Fix
from vgps.runtime.threads import one_blas_thread, prompt_threads


@dataclass(frozen=True)
class TimedImage:
    """A frame: its time, its luminance (H, W), and its time of arrival by ``time.monotonic``."""

    t_s: float
    gray: GrayImage
    arrival_s: float


@dataclass(frozen=True)
class GyroSample:
    """Angular rate (3,) in the gyro's axes at a time of the video."""

    t_s: float
    rate_rad_s: FloatArray


@dataclass(frozen=True)
class SourceNote:
    """A message from a source."""

    text: str


FeedItem = TimedImage | Fix | GyroSample | SourceNote
Sink = Callable[[OnlineEstimate, float], None]


@prompt_threads()
@one_blas_thread()
def run_online(feed: Iterable[FeedItem], smoother: OnlineSmoother, sink: Sink, stop: threading.Event) -> int:
    """Feed all items to a smoother in order of arrival, and return the number of frames.

    Args:
        feed: Frames in chronological order, fixes in any.
        smoother: The smoother.
        sink: Receives each estimate, and the seconds from the frame's arrival to its pose.
        stop: Event that ends the loop.
    """
    frames = 0
    for item in feed:
        if isinstance(item, Fix):
            smoother.add_fix(item)
        elif isinstance(item, SourceNote):
            smoother.add_note(item.text)
        elif isinstance(item, GyroSample):
            smoother.add_gyro(item.t_s, item.rate_rad_s)
        else:
            estimate = smoother.add_frame(item.t_s, item.gray)
            frames += 1
            sink(estimate, time.monotonic() - item.arrival_s)
            smoother.refine()
        if stop.is_set():
            break
    return frames


@contextlib.contextmanager
def stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """Let Ctrl-C and SIGTERM set ``stop``, so that results are written; a second one interrupts."""

    def handle(number: int, _: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

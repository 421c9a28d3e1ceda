"""One feed of frames and fixes from a camera and a receiver, on the video's clock."""

import threading
from collections.abc import Iterator
from datetime import UTC, datetime

from vgps.model import Rig
from vgps.online.run import FeedItem, SourceNote
from vgps.online.sources.gps_source import GpsSource, ReceivedFix
from vgps.online.sources.video_source import VideoSource
from vgps.readers.gps_formats.fixes import DAY_S, Clock, Fix, unix_s

_MOST_EARLY = 1000  # fixes kept until the first frame
_SAME_CLOCK_S = 2.0  # exceeds the latency of receivers and the error of network clocks


class VideoClock:
    """Conversion of fixes to the video's clock, by ``video_start_utc`` or else by this computer's clock.

    Args:
        start_unix_s: UTC of the first frame.
        live: Whether that is by this computer's clock; if it differs from the receiver's by seconds, fixes
            get their times of arrival.
    """

    def __init__(self, start_unix_s: float, live: bool) -> None:
        self._start_s, self._live = start_unix_s, live
        self._correction_s: float | None = None

    def fix(self, received: ReceivedFix) -> tuple[Fix, str | None]:
        """Return the fix on the video's clock, and a note if the clocks disagree."""
        fix, note = received.streamed.fix, None
        utc_s = fix.t_s
        if received.streamed.clock is Clock.TIME_OF_DAY:
            near_s = received.unix_s if self._live else self._start_s
            utc_s += DAY_S * round((near_s - utc_s) / DAY_S)
        if self._live and self._correction_s is None:
            behind_s = received.unix_s - utc_s
            self._correction_s = behind_s if abs(behind_s) > _SAME_CLOCK_S else 0.0
            if self._correction_s:
                note = (
                    f"this computer's clock differs from the receiver's by {behind_s:.1f} s, so fixes get "
                    "their times of arrival: set the clock (NTP), or give video_start_utc in rig.yaml"
                )
        return fix._replace(t_s=utc_s + (self._correction_s or 0.0) - self._start_s), note


def live_feed(
    video: VideoSource, gps: GpsSource | None, rig: Rig, stop: threading.Event, delay_s: float = 0.0
) -> Iterator[FeedItem]:
    """Yield frames, fixes and notes as they come, until the video ends or ``stop`` is set.

    Args:
        video, gps: Opened sources.
        rig: Its ``video_start_utc``, if given, is the UTC of the first frame.
        stop: Event that ends the feed.
        delay_s: Latency of the camera, from exposure to arrival; used with this computer's clock.
    """
    clock: VideoClock | None = None
    early: list[ReceivedFix] = []
    report_at = 1
    while not stop.is_set() and not video.ended:
        frame = video.next(0.05)
        yield from (SourceNote(text) for text in video.notes())
        if frame is not None and clock is None:
            start_s = unix_s(start_utc(video, rig, delay_s))
            clock = VideoClock(start_s, video.live and rig.video_start_utc is None)
        received, notes = gps.poll() if gps is not None else ([], [])
        yield from (SourceNote(text) for text in notes)
        early = (early + received)[-_MOST_EARLY:]
        if clock is not None:
            for fix in early:
                placed, note = clock.fix(fix)
                yield from () if note is None else (SourceNote(note),)
                yield placed
            early = []
        if video.dropped >= report_at:
            report_at *= 10
            yield SourceNote(
                f"frames arrive faster than they are processed: {video.dropped} were dropped so far; reduce "
                "the frame rate or the image size"
            )
        if frame is not None:
            yield frame


def start_utc(video: VideoSource, rig: Rig, delay_s: float) -> datetime:
    """Return the UTC of the first frame: the rig's, else by this computer's clock; call after that frame."""
    return rig.video_start_utc or datetime.fromtimestamp(video.start_unix_s - delay_s, UTC)

"""A camera and a receiver merged into one feed, both on the video's clock."""

import threading
from collections.abc import Iterator
from datetime import UTC, datetime

from vgps.model import Rig
from vgps.online.gps_source import GpsSource, ReceivedFix
from vgps.online.run import Item, SourceNote
from vgps.online.video_source import VideoSource
from vgps.readers.fixes import DAY_S, Clock, Fix, unix_s

_SAME_CLOCK_S = 2.0  # more than receivers are late and clocks on a network are wrong


class VideoClock:
    """Puts fixes on the video's clock: by ``video_start_utc``, else by this computer's clock.

    Args:
        start_unix_s: UTC of the first frame.
        live: Whether that is this computer's time; if it differs from the receiver's by seconds, fixes are
            placed by their arrival.
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
                    f"this computer's clock is {behind_s:.1f} s off the receiver's: fixes are placed by "
                    "their arrival; set the clock (NTP), or give video_start_utc in rig.yaml"
                )
        return fix._replace(t_s=utc_s + (self._correction_s or 0.0) - self._start_s), note


def live_feed(
    video: VideoSource, gps: GpsSource | None, rig: Rig, stop: threading.Event, delay_s: float = 0.0
) -> Iterator[Item]:
    """Yield frames, fixes and notes as they come, until the video ends or ``stop`` is set.

    Args:
        video, gps: Opened.
        rig: Its ``video_start_utc``, if given, is the UTC of the first frame.
        stop: Ends it.
        delay_s: From exposure to arrival of a picture, where this computer's clock counts.
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
        early += received
        if clock is not None:
            for fix in early:
                placed, note = clock.fix(fix)
                yield from () if note is None else (SourceNote(note),)
                yield placed
            early = []
        if video.dropped >= report_at:
            report_at *= 10
            yield SourceNote(f"frames come faster than they are posed: {video.dropped} were dropped so far")
        if frame is not None:
            yield frame


def start_utc(video: VideoSource, rig: Rig, delay_s: float) -> datetime:
    """Return the UTC of the first frame: the rig's, else by this computer's clock, once a frame has come."""
    return rig.video_start_utc or datetime.fromtimestamp(video.start_unix_s - delay_s, UTC)

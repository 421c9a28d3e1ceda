"""Whether a GPS log and a video are of the same time."""

from datetime import datetime, timedelta, timezone

import numpy as np

from vgps.errors import GpsLogError
from vgps.model import FloatArray, GpsLog, Rig
from vgps.readers.gps_formats.fixes import EPOCH, unix_s

_AT_ENDS_S = 2.0  # by which a log may begin after the video and end before it
_FARTHEST_ZONE = 14 * 60  # minutes from UTC


def check_overlap(log: GpsLog, times_s: FloatArray, rig: Rig) -> None:
    """Check that at least one fix was taken during the video.

    Args:
        log: Fixes on the video's clock.
        times_s: (F,) frame times.
        rig: Its ``video_start_utc`` gives the spans of the message in UTC.

    Raises:
        GpsLogError: No fix is within the video; the message gives both time spans.
    """
    first, last = float(times_s[0]), float(times_s[-1])
    if np.any((log.t_s >= first) & (log.t_s <= last)):
        return
    start = rig.video_start_utc
    spans = _span(start, log.t_s[0], log.t_s[-1]), _span(start, first, last)
    raise GpsLogError(
        f"no fix during the video: the log runs {spans[0]}",
        file=log.source,
        expected=f"fixes during the video, which runs {spans[1]}",
        remedy=_zone(log, times_s, start)
        or "check video_start_utc in rig.yaml, or give the log of the same day",
    )


def _zone(log: GpsLog, times_s: FloatArray, start: datetime | None) -> str:
    """Return what to do if the log and the video agree but for a time zone; "" if they do not."""
    if start is None:
        return ""
    for minutes in sorted(range(-_FARTHEST_ZONE, _FARTHEST_ZONE + 1, 30), key=abs):
        moved = log.t_s + 60.0 * minutes
        begins, ends = moved[0] <= times_s[0] + _AT_ENDS_S, moved[-1] >= times_s[-1] - _AT_ENDS_S
        if begins and ends:
            local = start.replace(tzinfo=timezone(timedelta(minutes=minutes)))
            return f"if video_start_utc is local time, write it with its zone: {local.isoformat()}"
    return ""


def _span(start: datetime | None, first_s: float, last_s: float) -> str:
    if start is None:
        return f"from {first_s:.1f} s to {last_s:.1f} s of the video's clock"
    origin = EPOCH + timedelta(seconds=unix_s(start))
    try:
        ends = [
            (origin + timedelta(seconds=float(t))).strftime("%Y-%m-%d %H:%M:%S") for t in (first_s, last_s)
        ]
    except OverflowError:
        return f"from {first_s:.3g} s to {last_s:.3g} s of the video's clock"
    return f"from {ends[0]} to {ends[1]} UTC"

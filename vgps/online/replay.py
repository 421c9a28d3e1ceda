"""Replay of a recording as a live feed."""

import threading
import time
from collections.abc import Iterator

import numpy as np

from vgps.model import GpsLog, Recording
from vgps.online.run import FeedItem, GyroSample, TimedImage
from vgps.readers.gps_formats.fixes import Fix


def replay(recording: Recording, stop: threading.Event, *, realtime: bool = False) -> Iterator[FeedItem]:
    """Yield frames, fixes and gyro samples in chronological order.

    Args:
        recording: The recording.
        stop: Event that ends the replay, even while it waits.
        realtime: Whether to replay at the speed of the recording instead of as fast as possible.
    """
    others = _others(recording)
    waiting = next(others, None)
    begun_s = time.monotonic()
    for frame in recording.video.frames():
        while waiting is not None and waiting[0] <= frame.t_s:
            yield waiting[1]
            waiting = next(others, None)
        due_s = begun_s + frame.t_s if realtime else time.monotonic()
        if realtime and stop.wait(max(0.0, due_s - time.monotonic())):
            return
        yield TimedImage(frame.t_s, frame.gray, due_s)
    while waiting is not None:
        yield waiting[1]
        waiting = next(others, None)


def fixes_of(log: GpsLog) -> Iterator[Fix]:
    """Yield the fixes of a log."""
    for row, added_m in enumerate(log.logging_sigma.tolist()):
        yield Fix(
            float(log.t_s[row]),
            float(log.latitude_deg[row]),
            float(log.longitude_deg[row]),
            float(log.height_m[row]),
            log.fix_class[row],
            int(log.line[row]),
            (float(log.sigma_m[row, 0]), float(log.sigma_m[row, 1]), float(log.sigma_m[row, 2])),
            float(log.hdop[row]),
            float(log.satellites[row]),
            float(log.correction_age_s[row]),
            logging_sigma_m=(*added_m,),
        )


def _others(recording: Recording) -> Iterator[tuple[float, FeedItem]]:
    """Yield fixes and gyro samples with their times."""
    items: list[tuple[float, FeedItem]] = []
    if recording.gps is not None:
        items += [(fix.t_s, fix) for fix in fixes_of(recording.gps)]
    if recording.gyro is not None:
        gyro = recording.gyro
        items += [
            (float(t_s), GyroSample(float(t_s), np.asarray(rate)))
            for t_s, rate in zip(gyro.t_s, gyro.rate_rad_s, strict=True)
        ]
    return iter(sorted(items, key=lambda item: item[0]))

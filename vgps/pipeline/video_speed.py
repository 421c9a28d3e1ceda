"""Videos that play faster or slower than time passes: a time-lapse, or slow motion."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError, GpsLogError
from vgps.gps.clock_search import levelled
from vgps.gps.fixes import Fixes
from vgps.gps.video_speed import (
    EXPLAINED_SHARE,
    USUAL_SIGMA,
    refined_video_speed,
    search_video_speed,
    usual_video_speed,
)
from vgps.model import FloatArray, Recording
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.gps_clock import unexplained, with_gps_clock
from vgps.readers.video.retimed_video import at_speed
from vgps.runtime.progress import Progress
from vgps.solution import Trajectory

_MOST_RUNS = 3  # windows bend a path to fixes at wrong times, so that the next one shows the speed better
_SETTLED = 2e-3  # in the logarithm
_FOUND = (
    "the video plays {0:.3g} times as fast as time passes, as the shape of its path shows: {1:.4g} frames a "
    "second are about {2:.4g}. Its frames have the times at which they were taken now: give sensors: "
    "{{video_speed: {0:.4g}}} to save the time"
)
_DOUBTFUL = (
    "the path does not have the shape of the fixes, but nearly does if the video plays {0:.2g} times as fast "
    "as time passes; other speeds may suit as well. If it is a time-lapse or slow motion, give sensors: "
    "{{video_speed}}; else the fixes may be of another place or time"
)


def with_video_speed(recording: Recording, config: Config) -> Recording:
    """Return a recording whose frames have their times by the speed of the video in the settings."""
    if config.sensors.video_speed == 1.0:
        return recording
    return replace(recording, video=at_speed(recording.video, config.sensors.video_speed))


def with_right_speed(front_end: FrontEnd, config: Config, progress: Progress) -> tuple[FrontEnd, Config]:
    """Return the front end, run again at the speed that the video alone shows where it is not that of time.

    The settings returned have the run find what is left of it. Rigs of several cameras keep their times.
    """
    compared = with_gps_clock(front_end, config)
    clock, sensors, seen = compared.clock, config.sensors, _seen(compared, config)
    if seen is None or clock is None or clock.shown_s is not None or front_end.others:
        return compared, config
    if sensors.video_speed != 1.0 or (shown := search_video_speed(*seen, sensors)) is None:
        return compared, config
    if not shown.is_certain:
        note = _DOUBTFUL.format(shown.speed)
        return replace(compared, warnings=(*compared.warnings, note)), config
    speed, estimate = shown.speed, "yes"
    if abs(shown.time_offset_s - sensors.time_offset_s) > sensors.time_offset_reach_s:
        changes = {"time_offset_s": round(shown.time_offset_s, 2), "estimate_time_offset": "yes"}
        sensors = sensors.model_copy(update=changes)
    progress.stage("again at the speed that the video shows")
    try:
        for _ in range(_MOST_RUNS):
            changes = {"video_speed": speed, "estimate_time_offset": estimate}
            changed = config.model_copy(update={"sensors": sensors.model_copy(update=changes)})
            noted = _noted(compared.recording, speed)
            again = with_gps_clock(run_front_end(noted, changed, progress), changed)
            seen = _seen(again, changed)
            if seen is None or unexplained(again, changed) > EXPLAINED_SHARE:
                return compared, config
            rest, sigma = refined_video_speed(*seen, sensors)
            better, estimate = speed * rest, "yes"  # what is left of a speed looks like a time offset
            if (usual := usual_video_speed(better, sigma)) is not None:
                better, sigma, estimate = usual, USUAL_SIGMA, sensors.estimate_time_offset
            if estimate == changes["estimate_time_offset"] and abs(np.log(better / speed)) < _SETTLED:
                break
            speed = better
    except (GeometryError, GpsLogError, np.linalg.LinAlgError):  # the first run had a path
        return compared, config
    rate_sigma = max(again.sensors.clock_rate_sigma, sigma)
    return replace(again, sensors=replace(again.sensors, clock_rate_sigma=rate_sigma)), changed


def _seen(front_end: FrontEnd, config: Config) -> tuple[Trajectory, float, Fixes, FloatArray] | None:
    """Return the level path of the video alone, the time of its first frame, the fixes and the lever arm."""
    if front_end.clock is None or front_end.clock.video is None:
        return None
    first_s, sensors = float(front_end.recording.video.times_s[0]), front_end.sensors
    path = levelled(front_end.clock.video, config.start)
    return path, first_s, front_end.fixes.without_clock_rate(sensors), sensors.camera_p_antenna


def _noted(recording: Recording, speed: float) -> Recording:
    """Return a recording at a speed, with a note of it."""
    t_s = recording.video.times_s
    rate_hz = (len(t_s) - 1) / float(np.ptp(t_s))
    note = _FOUND.format(speed, rate_hz, rate_hz / speed)
    return replace(recording, video=at_speed(recording.video, speed), notes=(*recording.notes, note))

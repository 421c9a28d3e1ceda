"""A camera that is turned about its axis of view, against what was assumed: stages A to C once more.

Where the first seconds are straight, nothing but the assumption that the camera is upright shows its roll.
The path of one that hangs upside down turns to the right where the fixes turn to the left.
"""

from dataclasses import replace

import numpy as np

from vgps.config import Config, StartConfig
from vgps.errors import GeometryError, GpsLogError
from vgps.gps.camera_roll import OR_MIRRORED, camera_roll_deg
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.gps_clock import unexplained, with_gps_clock
from vgps.runtime.progress import Progress
from vgps.smoothing.alignment.map_alignment import correspondences, fixes_within
from vgps.smoothing.alignment.similarity import align, is_far_less, linearise
from vgps.solution import Trajectory

_TURNED = (
    "the camera is turned by {0:g} degrees about its axis of view, as the shape of the path shows; the run "
    "began again with that: state it with start: {{roll_deg: {0:g}}}{1}"
)
_TURNED_OVER_DEG = 20.0  # off the roll by which a path has turned over, against the assumption


def with_right_roll(front_end: FrontEnd, config: Config, progress: Progress) -> tuple[FrontEnd, Config]:
    """Return the front end and settings of stages A to C with the camera turned as the path shows it.

    Args:
        front_end: With the GPS clock compared.
        config: Settings.
        progress: Progress display.
    """
    clock = front_end.clock
    if clock is None or not clock.turned_deg:
        return front_end, config
    progress.stage("again with the camera turned as the path shows it")
    roll_deg = (config.start.roll_deg + clock.turned_deg) % 360.0
    start = config.start.model_copy(update={"roll_deg": roll_deg})
    turned = config.model_copy(update={"start": start})
    note = _TURNED.format(roll_deg, OR_MIRRORED if clock.turned_deg == 180.0 else "")
    recording = replace(front_end.recording, notes=(*front_end.recording.notes, note))
    try:
        again = with_gps_clock(run_front_end(recording, turned, progress), turned)
    except (GeometryError, GpsLogError):  # the first run had a path
        return front_end, config
    if again.clock is None or again.clock.turned_deg:
        return front_end, config
    if clock.mirrored:
        better = unexplained(again, turned) < unexplained(front_end, config)
    else:  # in the plane a path that begins to turn over explains as much as one that has
        better = _lies_as_assumed(clock.video, start)
        better = better or is_far_less(misaligned(again, turned), misaligned(front_end, config))
    return (again, turned) if better else (front_end, config)


def _lies_as_assumed(path: Trajectory | None, start: StartConfig) -> bool:
    """Return whether a path has turned over to a roll by itself, against what was assumed of it before."""
    roll_deg = None if path is None else camera_roll_deg(path, start)
    return roll_deg is not None and abs(roll_deg) < _TURNED_OVER_DEG


def misaligned(front_end: FrontEnd, config: Config) -> float:
    """Return the cost of the best alignment of the path of the video alone with the fixes."""
    clock, sensors = front_end.clock, front_end.sensors
    if clock is None or clock.video is None:
        return np.inf
    chosen = fixes_within(clock.video, front_end.fixes.on_video_clock(sensors))
    seen = correspondences(clock.video, chosen, sensors.camera_p_antenna)
    found = align(seen, config.start)
    return np.inf if found is None else linearise(seen, found, config.start).cost

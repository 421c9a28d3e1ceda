"""The world frame of a recording, and its GPS fixes in it."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.errors import GpsLogError, RecordingError
from vgps.geodesy import to_enu
from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes, fixes_in_world
from vgps.gps.frame_gaps import in_gaps
from vgps.gps.regions import region_sizes
from vgps.model import FloatArray, GeodeticPoint, GpsLog, Recording
from vgps.solution import GpsClock

_MIN_FIXES = 2  # fewer have no direction, and hint at a wrong clock or log


def world_fixes(recording: Recording, config: Config) -> tuple[GeodeticPoint | None, Fixes]:
    """Return the origin of the world frame and the log's fixes in it.

    The origin is that of the rig, else the first control point, else the first usable fix. Fixes where frames
    are missing are not used.

    Raises:
        GpsLogError: Fewer than two usable fixes.
        RecordingError: Control points in ENU beside a GPS log, and no origin.
    """
    log, origin = recording.gps, _given_origin(recording)
    if log is None:
        return origin, Fixes.empty()
    usable = _usable(log, recording.video.times_s, config)
    if origin is None:
        origin = fix_origin(log, int(np.flatnonzero(usable)[0]))
    fixes = fixes_in_world(log, to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m), config.gps)
    seen = ~in_gaps(recording.video.times_s, _configured_clock(config).on_video(log.t_s))
    return origin, replace(fixes, used=fixes.used & seen)


def fix_origin(log: GpsLog, row: int) -> GeodeticPoint:
    """Return the position of a fix, as the origin of a world frame."""
    return GeodeticPoint(
        float(log.latitude_deg[row]), float(log.longitude_deg[row]), float(log.height_m[row])
    )


def _usable(log: GpsLog, times_s: FloatArray, config: Config) -> np.ndarray:
    """Return which fixes (M,) are within the video and of a class with a region."""
    r_m, _ = region_sizes(log.fix_class, config.gps)
    usable = np.isfinite(r_m) & place(times_s, _configured_clock(config).on_video(log.t_s)).inside
    if usable.sum() < _MIN_FIXES:
        classes = ", ".join(sorted(set(log.fix_class)))
        raise GpsLogError(
            f"usable fixes during the video: {usable.sum()} (classes in the log: {classes})",
            file=log.source,
            expected=f"at least {_MIN_FIXES}, of a class with a region",
            remedy="check the log, rig.yaml's video_start_utc and sensors.time_offset_s, or give regions "
            "with --survey",
        )
    return np.asarray(usable)


def _configured_clock(config: Config) -> GpsClock:
    return GpsClock(config.sensors.time_offset_s, config.sensors.clock_rate)


def _given_origin(recording: Recording) -> GeodeticPoint | None:
    """Return the rig's origin, or the first control point."""
    points, origin = recording.control_points, recording.rig.world_origin
    if points is None or origin is not None:
        return origin
    if points.geodetic:
        return GeodeticPoint(*(float(x) for x in points.world_p_point[0]))
    if recording.gps is not None:
        raise RecordingError(
            "control points in ENU without an origin",
            file=points.source,
            remedy="give world_origin in rig.yaml, or latitude_deg, longitude_deg, height_m",
        )
    return None

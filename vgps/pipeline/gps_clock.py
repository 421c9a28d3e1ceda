"""The GPS clock against the video's, by the path that the video alone shows."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geometry import interpolate_vectors
from vgps.gps.clock_search import search_time_offset
from vgps.gps.fixes import Fixes
from vgps.gps.time_offset import estimate_time_offset
from vgps.model import FloatArray, Recording
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.rough_solution import video_alone
from vgps.pipeline.solved_maps import merged_maps
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer
from vgps.smoothing.alignment import align
from vgps.smoothing.map_alignment import correspondences, fixes_within
from vgps.solution import Trajectory

_FAR = (
    "the fixes have the shape of the path if they are {0:.1f} s older than their time stamps, more than was "
    "searched: set sensors: {{time_offset_s: {0:.1f}}}"
)
_FOUND = (
    "the GPS positions are about {0:.1f} s older than their time stamps, as the shape of the path shows; the "
    "run began again with that, which sensors: {{time_offset_s: {0:.1f}}} saves"
)


def with_gps_clock(front_end: FrontEnd, config: Config) -> FrontEnd:
    """Return the front end with the time offset between GPS and video as the video alone shows it.

    Windows of stage C, and a solution of stage D, bend the path to fixes whose clock is wrong until hardly
    anything of it is left to see; so the fixes are compared with a rough solution without them. An offset
    beyond reach is for another run, see :func:`far_time_offset`.

    Args:
        front_end: Its sensors have the time offset that stage C saw.
        config: Settings.
    """
    if front_end.clock_compared or config.gps.model == "none":
        return front_end
    timer = StageTimer(dict(front_end.seconds))
    with one_blas_thread(), timer.measure("batch"):
        compared = _compared(front_end, config)
    return replace(compared, clock_compared=True, seconds=timer.by_stage)


def far_time_offset(front_end: FrontEnd, config: Config) -> float | None:
    """Return the time offset that the video shows if it is beyond the search about the configured one."""
    shown_s, sensors = front_end.shown_time_offset_s, config.sensors
    if shown_s is None or abs(shown_s - sensors.time_offset_s) <= sensors.time_offset_reach_s:
        return None
    return shown_s


def with_far_clock(recording: Recording, config: Config, time_offset_s: float) -> tuple[Recording, Config]:
    """Return recording and settings of a run that begins with a time offset, which a note tells."""
    changes = {"time_offset_s": time_offset_s, "estimate_time_offset": "yes"}  # from a coarse grid
    sensors = config.sensors.model_copy(update=changes)
    noted = replace(recording, notes=(*recording.notes, _FOUND.format(time_offset_s)))
    return noted, config.model_copy(update={"sensors": sensors})


def _compared(front_end: FrontEnd, config: Config) -> FrontEnd:
    merged = merged_maps(front_end, front_end.context(config))
    sensors, fixes = front_end.sensors, front_end.fixes
    used = fixes.used & merged.georeferenced
    if config.sensors.estimate_time_offset == "no" or not used.any():
        return front_end
    path, settings = merged.scene.trajectory, config.sensors
    try:
        video = _among(video_alone(front_end, merged, config), path)
    except GeometryError:  # stage D says why
        return front_end
    shown_s = search_time_offset(video, fixes, sensors.camera_p_antenna, settings)
    front_end = replace(front_end, shown_time_offset_s=shown_s)
    if (far_s := far_time_offset(front_end, config)) is not None:
        return replace(front_end, warnings=(*front_end.warnings, _FAR.format(far_s)))
    if abs(sensors.time_offset_s - settings.time_offset_s) <= settings.time_offset_reach_s:
        path = video  # else what stage C's odometry showed has torn the path too much for that
    corrected = fixes.without_time_offset(sensors.time_offset_s)
    path = _in_the_world(path, corrected, sensors.camera_p_antenna, config)
    found, notes = estimate_time_offset(sensors, path, fixes, config)
    return replace(front_end, sensors=found, warnings=(*front_end.warnings, *notes))


def _among(few: Trajectory, path: Trajectory) -> Trajectory:
    """Return a path through few frames, between which it runs as another one through all of them."""
    at = np.searchsorted(path.t_s, few.t_s)
    moved = few.world_T_camera[:, :3, 3] - path.world_T_camera[at, :3, 3]
    poses = path.world_T_camera.copy()
    poses[:, :3, 3] += interpolate_vectors(few.t_s, moved, path.t_s)
    return Trajectory(path.t_s, poses)


def _in_the_world(path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: Config) -> Trajectory:
    """Return a path with the scale and heading that suit the fixes best, whatever their clock."""
    chosen = fixes_within(path, fixes)
    if len(chosen) < 2:  # control points place the maps
        return path
    to_world = align(correspondences(path, chosen, camera_p_antenna), config.start)
    return path if to_world is None else Trajectory(path.t_s, to_world.poses(path.world_T_camera))

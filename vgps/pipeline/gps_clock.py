"""The GPS clock against the video's, by the path that the video alone shows."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geometry import interpolate_vectors
from vgps.gps.fixes import Fixes
from vgps.gps.time_offset import estimate_time_offset
from vgps.model import FloatArray
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.rough_solution import video_alone
from vgps.pipeline.solved_maps import merged_maps
from vgps.smoothing.alignment import align
from vgps.smoothing.map_alignment import correspondences, fixes_within
from vgps.smoothing.merge_maps import MergedMaps
from vgps.solution import Trajectory


def with_gps_clock(front_end: FrontEnd, merged: MergedMaps, config: Config) -> tuple[FrontEnd, MergedMaps]:
    """Return front end and maps with the time offset between GPS and video as the video alone shows it.

    Windows of stage C, and a solution of stage D, bend the path to fixes whose clock is wrong until hardly
    anything of it is left to see; so the fixes are compared with a rough solution without them. A clock that
    is off by more than is searched, as stage C's odometry may show, has torn the path too much for that.

    Args:
        front_end: Its sensors have the time offset that stage C saw.
        merged: The maps; they are put into the world again if that was not it.
        config: Settings.
    """
    sensors, fixes = front_end.sensors, front_end.fixes
    used = fixes.used & merged.georeferenced
    if config.gps.model == "none" or config.sensors.estimate_time_offset == "no" or not used.any():
        return front_end, merged
    path, settings = merged.scene.trajectory, config.sensors
    reach_s = settings.time_offset.search_sigmas * settings.time_offset_prior_s
    if abs(sensors.time_offset_s - settings.time_offset_s) <= reach_s:
        try:
            path = _among(video_alone(front_end, merged, config), path)
        except GeometryError:  # stage D says why
            return front_end, merged
    corrected = fixes.without_time_offset(sensors.time_offset_s)
    path = _in_the_world(path, corrected, sensors.camera_p_antenna, config)
    found, notes = estimate_time_offset(sensors, path, fixes, config)
    shifted = replace(front_end, sensors=found, warnings=(*front_end.warnings, *notes))
    if found.time_offset_s == sensors.time_offset_s:
        return shifted, merged
    return shifted, merged_maps(shifted, shifted.context(config))


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

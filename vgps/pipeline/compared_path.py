"""Paths that are compared with fixes: without what is extrapolated, without tears, in the world or not."""

import numpy as np

from vgps.config import Config
from vgps.geometry import interpolate_vectors
from vgps.gps.antenna_path import antenna_offsets, place
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.model import FloatArray
from vgps.smoothing.alignment.map_alignment import correspondences, fixes_within
from vgps.smoothing.alignment.pose_similarity import similarity_of_poses
from vgps.smoothing.alignment.similarity import align
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Trajectory


def seen_part(scene: Scene) -> Trajectory:
    """Return the path from the first frame with observations to the last: others are extrapolated."""
    seen = scene.observations.frame
    rows = slice(seen.min(), seen.max() + 1) if len(seen) else slice(0)
    return Trajectory(scene.t_s[rows], scene.poses[rows])


def outside_share(path: Trajectory, fixes: Fixes, sensors: Sensors) -> float:
    """Return the share of the used fixes in the video whose regions do not reach the path in the plane."""
    corrected = fixes.on_video_clock(sensors)
    inside = corrected.where(np.flatnonzero(fixes.used & place(path.t_s, corrected.t_s).inside))
    offset = antenna_offsets(inside, path, sensors.camera_p_antenna)
    across = np.hypot(offset[:, 0], offset[:, 1]) > inside.r_m
    return float(np.mean(across)) if len(across) else 0.0


def through_few(few: Trajectory, path: Trajectory) -> Trajectory:
    """Return a path through those of few frames that are in it, between which it runs as it did."""
    inside = (few.t_s >= path.t_s[0]) & (few.t_s <= path.t_s[-1])
    few_s, few_poses = few.t_s[inside], few.world_T_camera[inside]
    at = np.searchsorted(path.t_s, few_s)
    to_path = similarity_of_poses(path.world_T_camera[at], few_poses)
    moved = to_path.poses(few_poses)[:, :3, 3] - path.world_T_camera[at, :3, 3]
    poses = path.world_T_camera.copy()
    poses[:, :3, 3] += interpolate_vectors(few_s, moved, path.t_s)
    return Trajectory(path.t_s, poses)


def in_the_world(path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: Config) -> Trajectory:
    """Return a path with the scale and heading that suit the fixes best, whatever their clock."""
    chosen = fixes_within(path, fixes)
    if len(chosen) < 2:  # control points place the maps
        return path
    to_world = align(correspondences(path, chosen, camera_p_antenna), config.start)
    return path if to_world is None else Trajectory(path.t_s, to_world.poses(path.world_T_camera))

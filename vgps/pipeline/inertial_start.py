"""Maps on the path of IMU and fixes, where the video by itself lost its scale."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.gps.clock_search import ClockCheck
from vgps.gps.sensors import TimeOffset
from vgps.imu.agreement import agreement
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.mapping.trajectory import map_trajectory
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.solved_maps import merged_maps
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.factor_graph import Scene
from vgps.smoothing.inertial_path import inertial_path, strays
from vgps.smoothing.triangulation import triangulated
from vgps.solution import Trajectory

_NOTE = (
    "the video lost its scale: {} movements from fix to fix contradict the fixes by more than half, and "
    "the IMU agrees with these; stage D begins with the path of IMU and fixes"
)


def with_inertial_start(front_end: FrontEnd, config: Config) -> FrontEnd:
    """Return the front end with its maps on the path of IMU and fixes, if the video lost its scale.

    That is where its path strays from the fixes as that of the IMU does not.
    """
    context = front_end.context(config)
    imu, fixes = context.imu, front_end.fixes
    if imu is None or front_end.others or config.gps.model == "none" or not fixes.used.any():
        return front_end
    sensors = front_end.sensors.with_time_offset(TimeOffset(config.sensors.time_offset_s, 0.0))
    corrected = fixes.without_time_offset(sensors.time_offset_s)
    path = merged_maps(replace(front_end, sensors=sensors), context).scene.trajectory
    lost = strays(path, corrected, sensors.camera_p_antenna)
    if not lost.any():
        return front_end
    seen = agreement([map_trajectory(one) for one in front_end.maps], imu)
    if seen.contradiction or seen.misled:  # the path may have strayed by what the IMU predicted
        return front_end
    better = inertial_path(path, imu, corrected, sensors.camera_p_antenna, config)
    if better is None or 2 * strays(better, corrected, sensors.camera_p_antenna).sum() > lost.sum():
        return front_end
    maps = tuple(_on_path(local_map, better, context) for local_map in front_end.maps)
    note = _NOTE.format(f"{int(lost.sum())} of {len(lost)}")
    warnings = (*front_end.warnings, note)
    # what the lost path showed of the clocks is wrong, too
    return replace(
        front_end, maps=maps, sensors=sensors, clock=ClockCheck(None), inertial=True, warnings=warnings
    )


def _on_path(local_map: LocalMap, path: Trajectory, context: SmoothingContext) -> LocalMap:
    """Return a map with the poses of a path through all frames, and its features as these see them."""
    moved = local_map.snapshot()
    first, last = moved.first_posed, moved.next_frame
    poses = path.world_T_camera[first:last]
    unknown = np.full_like(moved.points, np.nan)
    scene = Scene(path.t_s, path.world_T_camera, unknown, moved.observations())
    every = np.ones(len(unknown), dtype=bool)
    points = triangulated(scene, every, context, context.config.mapping.min_views).points
    positions = Positions(np.arange(len(points)), points, moved.sigma_px)
    moved.apply(MapUpdate(first_frame=first, poses=poses, positions=positions, aligned=True))
    return moved

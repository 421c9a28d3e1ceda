"""Maps on the path of IMU and fixes, where the video by itself lost its scale."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.gps.clock_search import ClockCheck
from vgps.gps.sensors import TimeOffset
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.pipeline.front_end import FrontEnd, camera_imu
from vgps.pipeline.imu_agreement import imu_agreement, with_imu_clock
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
    context, fixes = front_end.context(config), front_end.fixes
    if context.imu is None or front_end.others or config.gps.model == "none" or not fixes.used.any():
        return front_end
    sensors = front_end.sensors.with_time_offset(TimeOffset(config.sensors.time_offset_s, 0.0))
    corrected = fixes.without_time_offset(sensors.time_offset_s)
    path = merged_maps(replace(front_end, sensors=sensors), context).scene.trajectory
    lost = strays(path, corrected, sensors.camera_p_antenna)
    if not lost.any():
        return front_end
    seen = imu_agreement(front_end, config)
    if seen.contradiction or seen.misled:  # the path may have strayed by what the IMU predicted
        return front_end
    recording = with_imu_clock(front_end.recording, seen)  # rotations by the IMU will not show its clock
    imu = camera_imu(recording, front_end.origin, config)
    assert imu is not None
    better = inertial_path(path, imu, corrected, sensors.camera_p_antenna, config)
    if better is None or 2 * strays(better, corrected, sensors.camera_p_antenna).sum() > lost.sum():
        return front_end
    maps = tuple(_on_path(local_map, better, context) for local_map in front_end.maps)
    notes = recording.notes[len(front_end.recording.notes) :]
    return replace(
        front_end,
        recording=recording,
        maps=maps,
        sensors=sensors,
        clock=ClockCheck(None),  # what the lost path showed of the fixes' clock is wrong, too
        inertial=True,
        warnings=(*front_end.warnings, *notes, _NOTE.format(f"{int(lost.sum())} of {len(lost)}")),
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

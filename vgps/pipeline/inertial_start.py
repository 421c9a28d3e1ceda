"""Maps on the path of IMU and fixes, where the video by itself lost its scale."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.gps.clock_search import ClockCheck
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.imu.camera_imu import CameraImu
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.pipeline.front_end import FrontEnd, camera_imu
from vgps.pipeline.imu_agreement import imu_agreement, pictures_agreement, with_imu_clock
from vgps.pipeline.solved_maps import merged_maps
from vgps.runtime.progress import Progress
from vgps.smoothing.alignment.inertial_path import contradicted_intervals, inertial_path
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.scene.triangulation import triangulated
from vgps.solution import Trajectory

_NOTE = (
    "the video lost its scale: {} of {} movements from fix to fix contradict the fixes by more than half, "
    "and the IMU agrees with these; stage D begins with the path of IMU and fixes"
)


@dataclass(frozen=True, kw_only=True)
class _Lost:
    """A path that strays from the fixes.

    Attributes:
        path: Of the video.
        fixes: With the time offset of the sensors removed.
        sensors: With the time offset of the settings: the path shows none.
        contradicted: Number of movements from fix to fix that the path contradicts.
        movements: Number of all of them.
    """

    path: Trajectory
    fixes: Fixes
    sensors: Sensors
    contradicted: int
    movements: int

    def path_by(self, imu: CameraImu | None, config: Config) -> Trajectory | None:
        """Return the path of an IMU and the fixes; None if it strays more than half as often."""
        antenna = self.sensors.camera_p_antenna
        found = None if imu is None else inertial_path(self.path, imu, self.fixes, antenna, config)
        if found is None or 2 * contradicted_intervals(found, self.fixes, antenna).sum() > self.contradicted:
            return None
        return found


def with_inertial_start(front_end: FrontEnd, config: Config, progress: Progress) -> FrontEnd:
    """Return the front end with its maps on the path of IMU and fixes, if the video lost its scale.

    That is where its path strays from the fixes as that of the IMU does not. With few features the rotations
    of the maps are those of the IMU, too, and so do not show its clock: the pictures alone do.
    """
    lost = _lost(front_end, config)
    if lost is None:
        return front_end
    seen = imu_agreement(front_end, config, progress)
    if seen.contradiction or seen.misled:  # the path may have strayed by what the IMU predicted
        return front_end
    recording = front_end.recording
    path = lost.path_by(camera_imu(recording, front_end.origin, config), config)
    if path is not None:
        recording = with_imu_clock(recording, pictures_agreement(front_end, config, progress))
    if recording is not front_end.recording:
        path = lost.path_by(camera_imu(recording, front_end.origin, config), config)
    if path is None:
        return front_end
    context = front_end.context(config)
    notes = recording.notes[len(front_end.recording.notes) :]
    return replace(
        front_end,
        recording=recording,
        maps=tuple(_on_path(local_map, path, context) for local_map in front_end.maps),
        sensors=lost.sensors,
        clock=ClockCheck(None),  # what the lost path showed of the fixes' clock is wrong, too
        inertial=True,
        warnings=(*front_end.warnings, *notes, _NOTE.format(lost.contradicted, lost.movements)),
    )


def _lost(front_end: FrontEnd, config: Config) -> _Lost | None:
    """Return the path if it strays from the fixes and there is an IMU; else None."""
    context, fixes = front_end.context(config), front_end.fixes
    if context.imu is None or front_end.others or config.gps.model == "none" or not fixes.used.any():
        return None
    sensors = front_end.sensors.with_time_offset(TimeOffset(config.sensors.time_offset_s, 0.0))
    corrected = fixes.on_video_clock(sensors)
    path = merged_maps(replace(front_end, sensors=sensors), context).scene.trajectory
    contradicted = contradicted_intervals(path, corrected, sensors.camera_p_antenna)
    if not contradicted.any():
        return None
    return _Lost(
        path=path,
        fixes=corrected,
        sensors=sensors,
        contradicted=int(contradicted.sum()),
        movements=len(contradicted),
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

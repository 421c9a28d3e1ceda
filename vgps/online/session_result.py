"""What a run folder is written from, after a sequence was fed live."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geodesy import to_enu
from vgps.geometry import interpolate_poses
from vgps.gps.fixes import fixes_in_world
from vgps.gps.verdicts import fix_table
from vgps.mapping.local_map import LocalMap
from vgps.model import Camera, FloatArray, Frame, GeodeticPoint, GpsLog, Rig
from vgps.online.archive import FixArchive, FrameArchive
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.solution import (
    FixTable,
    FrameState,
    Landmarks,
    Observations,
    SensorReport,
    Solution,
    SolverReport,
    Trajectory,
)

_NO_STAGE_D = "stage D was not run: every pose is as it was when it left the memory of stage C"


@dataclass(frozen=True)
class StreamedVideo:
    """The times of frames that have gone by; the frames themselves are gone."""

    path: Path
    times_s: FloatArray
    width: int
    height: int

    def frames(self) -> Iterator[Frame]:
        """None."""
        return iter(())


@dataclass(frozen=True)
class SessionRecord:
    """All that was fed, and what became of it."""

    source: Path
    camera: Camera
    rig: Rig
    config: Config
    origin: GeodeticPoint | None
    frame_pipeline: FramePipeline
    frames: FrameArchive
    fixes: FixArchive

    def gps(self) -> tuple[GpsLog | None, np.ndarray]:
        """The fixes in order of time, if any could be placed in a world; and their rows in the archive."""
        rows = self.fixes.in_time_order()
        if self.origin is None or len(rows) == 0:
            return None, rows
        return self.fixes.log(self.source, rows), rows


def solution_as_it_is(fed: SessionRecord, warnings: tuple[str, ...]) -> Solution:
    """The poses as stage C left them; those never known lie between or beside known ones, and are bridged.

    Landmarks are those still remembered. Without alignment the world is the neighbourhood of the first camera
    of the last map.

    Raises:
        GeometryError: No frame has a pose.
    """
    poses, states, georeferenced = _every_pose(fed)
    camera, sensors, t_s = fed.camera, fed.frame_pipeline.sensors, fed.frame_pipeline.t_s
    landmarks, observations = _remembered(fed.frame_pipeline.current)
    log, table = _verdicts(fed, poses) if georeferenced else (fed.gps()[0], None)
    sigmas = fed.frames.sigmas()
    return Solution(
        recording=fed.source,
        world_origin=fed.origin,
        georeferenced=georeferenced,
        t_s=t_s.copy(),
        world_T_camera=poses,
        sigma_rotation_rad=sigmas.rotation_rad,
        sigma_position_m=sigmas.position_m,
        state=states,
        camera=camera,
        camera_p_antenna=sensors.camera_p_antenna,
        landmarks=landmarks,
        observations=observations,
        gps=log,
        fixes=table,
        sensors=SensorReport(sensors.time_offset_s, np.nan, (np.nan, np.nan, np.nan)),
        report=SolverReport({}, {}, 0, _NO_STAGE_D),
        seconds=dict(fed.frame_pipeline.timer.by_stage),
        warnings=warnings,
        config=fed.config.model_dump(mode="json"),
        video_start_utc=fed.rig.video_start_utc,
    )


def _every_pose(fed: SessionRecord) -> tuple[FloatArray, tuple[FrameState, ...], bool]:
    poses, states, t_s = fed.frames.poses(), fed.frames.states(), fed.frame_pipeline.t_s
    known = fed.frames.known
    georeferenced = bool(known.any())
    current = fed.frame_pipeline.current
    if not georeferenced and current is not None:
        rows = slice(current.first_frame, current.next_frame)
        poses[rows] = current.poses
        known = np.isfinite(poses[:, 0, 0])
        tracked = known & ~np.isin(np.arange(len(known)), list(current.bridged))
        states = tuple(FrameState.TRACKED if row else FrameState.BRIDGED for row in tracked)
    if not known.any():
        raise GeometryError(
            "no frame has a pose: the camera hardly moved, or too little was seen, to begin a map",
            file=fed.source,
        )
    poses[~known] = interpolate_poses(t_s[known], poses[known], t_s[~known])
    return poses, states, georeferenced


def _verdicts(fed: SessionRecord, poses: FloatArray) -> tuple[GpsLog | None, FixTable | None]:
    log, rows = fed.gps()
    if log is None or fed.origin is None or len(poses) < 2:
        return log, None
    position = to_enu(fed.origin, log.latitude_deg, log.longitude_deg, log.height_m)
    sensors = fed.frame_pipeline.sensors
    fixes = fixes_in_world(log, position, fed.config.gps).earlier(sensors.time_offset_s)
    assessment, t_s = fed.fixes.assessment(rows), fed.frame_pipeline.t_s
    path = Trajectory(t_s, poses)
    return log, fix_table(log, fixes, assessment, path, sensors.camera_p_antenna, fed.config)


def _remembered(local_map: LocalMap | None) -> tuple[Landmarks, Observations]:
    """Features that have a position, and their observations."""
    if local_map is None:
        none, no_ids = np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
        gray = np.zeros(0, dtype=np.uint8)
        return Landmarks(none, none[:, 0], gray), Observations(no_ids, no_ids, none[:, :2])
    ids = np.flatnonzero(np.isfinite(local_map.points[:, 0]) & np.isfinite(local_map.sigma_px))
    row_of = np.full(local_map.feature_count, -1)
    row_of[ids] = np.arange(len(ids))
    log = local_map.observations()
    seen = row_of[log.landmark] >= 0
    return (
        Landmarks(local_map.points[ids], local_map.sigma_px[ids], local_map.gray[ids]),
        Observations(log.frame[seen], row_of[log.landmark[seen]], log.uv_px[seen]),
    )

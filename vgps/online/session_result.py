"""Result of a live session: the solution after stage C, or the input of stage D."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geodesy import to_enu
from vgps.geometry import interpolate_poses
from vgps.gps.fixes import fixes_in_world
from vgps.gps.verdicts import fix_table
from vgps.mapping.local_map import LocalMap
from vgps.model import Camera, FloatArray, Frame, GeodeticPoint, GpsLog, GyroLog, ImuLog, Recording, Rig
from vgps.online.archive import FixArchive, FrameArchive
from vgps.online.fusion.lever_arm import LeverArm
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.pipeline.front_end import FrontEnd, front_end_of
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

_NO_STAGE_D = "stage D was not run: the poses are those after stage C"


@dataclass(frozen=True)
class StreamedVideo:
    """Path, times and size of a video whose frames were not kept."""

    path: Path
    times_s: FloatArray
    width: int
    height: int

    def frames(self) -> Iterator[Frame]:
        """Return no frames."""
        return iter(())


@dataclass(frozen=True, kw_only=True)
class SessionRecord:
    """Input and state of a live session."""

    source: Path
    camera: Camera
    rig: Rig
    config: Config
    origin: GeodeticPoint | None
    frame_pipeline: FramePipeline
    frames: FrameArchive
    fixes: FixArchive
    gyro: GyroLog | None
    imu: ImuLog | None
    lever_arm: LeverArm | None  # None if it was not estimated
    warnings: tuple[str, ...]

    @property
    def camera_p_antenna(self) -> FloatArray:
        """(3,) the lever arm, metres."""
        return self.rig.camera_p_antenna if self.lever_arm is None else self.lever_arm.camera_p_antenna

    @property
    def antenna_sigma_m(self) -> tuple[float, float, float]:
        """Its standard deviations; NaN if it was not estimated."""
        x, y, z = (np.nan, np.nan, np.nan) if self.lever_arm is None else self.lever_arm.sigma_m.tolist()
        return x, y, z

    def gps(self) -> tuple[GpsLog | None, np.ndarray]:
        """Return the fixes in chronological order, None without a world frame, and their rows in the
        archive."""
        rows = self.fixes.in_time_order()
        if self.origin is None or len(rows) == 0:
            return None, rows
        return self.fixes.log(self.source, rows), rows


def session_front_end(session: SessionRecord) -> FrontEnd:
    """Return the result of stages A to C of a session that kept everything, the input of stage D."""
    camera, source = session.camera, session.source
    log, _ = session.gps()
    video = StreamedVideo(source, session.frame_pipeline.t_s, camera.width, camera.height)
    recording = Recording(
        path=source,
        video=video,
        camera=camera,
        rig=replace(session.rig, world_origin=session.origin),
        gps=log,
        gyro=session.gyro,
        imu=session.imu,
    )
    return replace(front_end_of(session.frame_pipeline, recording, session.origin), warnings=session.warnings)


def session_solution(session: SessionRecord) -> Solution:
    """Return the solution after stage C; frames without a pose are interpolated and count as bridged.

    It contains the landmarks still kept. Without alignment the world is that of the last map.

    Raises:
        GeometryError: No frame has a pose.
    """
    poses, states, georeferenced = _every_pose(session)
    camera, pipeline = session.camera, session.frame_pipeline
    sensors, t_s = pipeline.fix_buffer.sensors, pipeline.t_s
    landmarks, observations = _kept_landmarks(pipeline.current)
    log, table = _verdicts(session, poses) if georeferenced else (session.gps()[0], None)
    sigmas = session.frames.sigmas()
    return Solution(
        recording=session.source,
        world_origin=session.origin,
        georeferenced=georeferenced,
        t_s=t_s.copy(),
        world_T_camera=poses,
        sigma_rotation_rad=sigmas.rotation_rad,
        sigma_position_m=sigmas.position_m,
        state=states,
        camera=camera,
        camera_p_antenna=session.camera_p_antenna,
        landmarks=landmarks,
        observations=observations,
        gps=log,
        fixes=table,
        sensors=SensorReport(
            sensors.time_offset_s,
            sensors.prior_time_offset.sigma_s or np.nan,
            session.antenna_sigma_m,
            sensors.clock_rate,
            video_speed=session.config.sensors.video_speed,
        ),
        report=SolverReport({}, {}, 0, _NO_STAGE_D),
        seconds=dict(session.frame_pipeline.timer.by_stage),
        warnings=session.warnings,
        config=session.config.model_dump(mode="json"),
        video_start_utc=session.rig.video_start_utc,
        static_regions=session.frame_pipeline.tracker.static.rectangles,
        moving_regions=session.frame_pipeline.tracker.moving.boxes,
    )


def _every_pose(session: SessionRecord) -> tuple[FloatArray, tuple[FrameState, ...], bool]:
    poses, states, t_s = session.frames.poses(), session.frames.states(), session.frame_pipeline.t_s
    known = session.frames.known
    georeferenced = bool(known.any())
    current = session.frame_pipeline.current
    if not georeferenced and current is not None:
        rows = slice(current.first_frame, current.next_frame)
        poses[rows] = current.poses
        known = np.isfinite(poses[:, 0, 0])
        tracked = known & ~np.isin(np.arange(len(known)), list(current.bridged))
        states = tuple(FrameState.TRACKED if row else FrameState.BRIDGED for row in tracked)
    if not known.any():
        raise GeometryError(
            "no frame has a pose: the camera hardly moved, or too few features were visible to start a map",
            file=session.source,
        )
    poses[~known] = interpolate_poses(t_s[known], poses[known], t_s[~known])
    return poses, states, georeferenced


def _verdicts(session: SessionRecord, poses: FloatArray) -> tuple[GpsLog | None, FixTable | None]:
    log, rows = session.gps()
    if log is None or session.origin is None or len(poses) < 2:
        return log, None
    position = to_enu(session.origin, log.latitude_deg, log.longitude_deg, log.height_m)
    sensors = session.frame_pipeline.fix_buffer.sensors
    fixes = fixes_in_world(log, position, session.config.gps).on_video_clock(sensors)
    assessment, t_s = session.fixes.assessment(rows), session.frame_pipeline.t_s
    path = Trajectory(t_s, poses)
    return log, fix_table(log, fixes, assessment, path, session.camera_p_antenna, session.config)


def _kept_landmarks(local_map: LocalMap | None) -> tuple[Landmarks, Observations]:
    """Return the features with a position, and their observations."""
    if local_map is None:
        none, no_ids = np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
        gray = np.zeros(0, dtype=np.uint8)
        return Landmarks(none, none[:, 0], gray), Observations(no_ids, no_ids, none[:, :2])
    ids = np.flatnonzero(np.isfinite(local_map.points[:, 0]) & np.isfinite(local_map.sigma_px))
    row_of = np.full(local_map.feature_count, -1)
    row_of[ids] = np.arange(len(ids))
    log = local_map.observations()
    positioned = row_of[log.landmark] >= 0
    return (
        Landmarks(local_map.points[ids], local_map.sigma_px[ids], local_map.gray[ids]),
        Observations(log.frame[positioned], row_of[log.landmark[positioned]], log.uv_px[positioned]),
    )

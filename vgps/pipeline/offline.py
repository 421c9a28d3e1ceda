"""The main job: stages A to C over the whole video, then D over everything."""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError, GpsLogError, RecordingError
from vgps.geodesy import to_enu
from vgps.geometry import world_sigmas
from vgps.gps.fixes import Fixes, fixes_in_world, place
from vgps.gps.regions import region_sizes
from vgps.gps.sky_view import under_sky
from vgps.gps.verdicts import fix_table
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.model import FloatArray, Frame, GeodeticPoint, Recording
from vgps.pipeline.front_end import FramePipeline
from vgps.runtime.progress import NoProgress, Progress
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer
from vgps.smoothing.batch import optimise_batch
from vgps.smoothing.batch_result import BatchResult
from vgps.smoothing.factor_graph import Scene
from vgps.smoothing.intrinsics import RefinedCamera, refine_camera
from vgps.smoothing.merge_maps import MergedMaps, merge_maps
from vgps.solution import Landmarks, Observations, SensorReport, Solution, Trajectory
from vgps.tracking.control_points import world_controls


@dataclass(frozen=True)
class FrontEnd:
    """What stages A to C leave to D; ``frame_pipeline`` holds the maps."""

    recording: Recording
    origin: GeodeticPoint | None
    fixes: Fixes
    controls: ControlObservations
    frame_pipeline: FramePipeline

    def copied(self) -> "FrontEnd":
        """The same with maps of its own, which stage D moves, and a clock of its own."""
        frame_pipeline = copy.copy(self.frame_pipeline)
        frame_pipeline.maps = copy.deepcopy(self.frame_pipeline.maps)
        frame_pipeline.seconds = StageTimer()
        return replace(self, frame_pipeline=frame_pipeline)


def smooth(recording: Recording, config: Config | None = None, progress: Progress | None = None) -> Solution:
    """The pose of every frame of a recording, in world coordinates.

    Args:
        recording: From :func:`vgps.open_recording`.
        config: Defaults if none is given.
        progress: Shows how far it is.

    Raises:
        VgpsError: The recording does not determine the answer.
    """
    config, progress = config or Config(), progress or NoProgress()
    front = track_and_map(recording, config, progress)
    progress.stage("optimising everything (D)")
    return optimise_all(front, config)


def track_and_map(recording: Recording, config: Config, progress: Progress) -> FrontEnd:
    """Stages A to C over all frames.

    Raises:
        GpsLogError: Too few usable fixes.
        GeometryError: Nothing to begin a map with.
    """
    origin, fixes = world_fixes(recording, config)
    camera, antenna = recording.camera, recording.rig.camera_p_antenna
    controls = world_controls(recording.control_points, camera, origin) or NO_CONTROL_OBSERVATIONS
    frame_pipeline = FramePipeline(camera, antenna, fixes, config, controls)
    frames = _decoded(recording.video.frames(), frame_pipeline.seconds)
    with one_blas_thread():
        for frame in progress.track(frames, len(recording.video.times_s)):
            frame_pipeline.add_frame(frame)
        frame_pipeline.settle()
    if not frame_pipeline.maps:
        raise GeometryError(
            "the camera hardly moves, or too little is seen, to begin a map",
            file=recording.video.path,
            expected=f"two views with {config.start.min_inliers} common features and "
            f"{config.start.min_flow_px:g} px between them",
        )
    return FrontEnd(recording, origin, fixes, controls, frame_pipeline)


def optimise_all(front: FrontEnd, config: Config) -> Solution:
    """Stage D on the maps of a front end, which are moved in place.

    Raises:
        GeometryError: No map can be aligned with the fixes, or the optimiser cannot leave its start.
    """
    recording, frame_pipeline, fixes = front.recording, front.frame_pipeline, front.fixes
    antenna = recording.rig.camera_p_antenna
    with one_blas_thread(), frame_pipeline.seconds.measure("batch"):
        sensors = frame_pipeline.sensors
        merged = merge_maps(
            frame_pipeline.maps,
            frame_pipeline.t_s,
            fixes,
            antenna,
            config,
            front.controls,
            sensors.time_offset_s,
        )
        held = None if len(front.controls.frame) else _held_frames(merged, config)
        if merged.georeferenced and recording.gps is not None:
            satellites = recording.gps.satellites
            path = Trajectory(merged.scene.t_s, merged.scene.poses)
            fixes = under_sky(fixes, path, merged.scene.points, sensors, satellites, config.gps)

        def optimise(scene: Scene, K: FloatArray) -> BatchResult:
            return optimise_batch(scene, K, fixes, sensors, config, held, merged.assessment)

        if config.intrinsics.refine:
            smoothed, refined = refine_camera(merged.scene, recording.camera, optimise, config.intrinsics)
        else:
            smoothed, refined = optimise(merged.scene, recording.camera.K), None
    seen_on_the_way = tuple(getattr(recording.video, "warnings", ()))
    warnings = (*seen_on_the_way, *frame_pipeline.warnings, *merged.warnings, *smoothed.warnings)
    solution = _solution(
        recording, config, front.origin, fixes, merged, smoothed, frame_pipeline.seconds, warnings
    )
    return solution if refined is None else _with_camera(solution, refined)


def _with_camera(solution: Solution, refined: RefinedCamera) -> Solution:
    """With the calibration that was estimated, and word of it."""
    return replace(
        solution,
        camera=refined.camera,
        sensors=replace(solution.sensors, camera_sigma=refined.sigma),
        warnings=(*solution.warnings, refined.note(solution.camera)),
    )


def world_fixes(recording: Recording, config: Config) -> tuple[GeodeticPoint | None, Fixes]:
    """The log's fixes in the world frame, and its origin.

    Raises:
        GpsLogError: Fewer usable fixes than it takes to align, or none of a class with a region.
    """
    log, origin = recording.gps, _given_origin(recording)
    if log is None:
        return origin, Fixes.none()
    r_m, _ = region_sizes(log.fix_class, config.gps)
    usable = np.isfinite(r_m) & place(recording.video.times_s, log.t_s).inside
    if usable.sum() < config.start.min_fixes:
        classes = ", ".join(sorted(set(log.fix_class)))
        raise GpsLogError(
            f"{usable.sum()} usable fixes during the video (classes in the log: {classes})",
            file=log.source,
            expected=f"at least {config.start.min_fixes}, of a class with a region",
            remedy="check the log and rig.yaml's video_start_utc, or give regions with --survey",
        )
    if origin is None:
        first = int(np.flatnonzero(usable)[0])
        origin = GeodeticPoint(
            float(log.latitude_deg[first]), float(log.longitude_deg[first]), float(log.height_m[first])
        )
    position = to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m)
    return origin, fixes_in_world(log, position, config.gps)


def _given_origin(recording: Recording) -> GeodeticPoint | None:
    """The rig's, or the first control point's.

    Raises:
        RecordingError: Control points in ENU beside a GPS log, and no origin to tell whose ENU it is.
    """
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


def _decoded(frames: Iterator[Frame], seconds: StageTimer) -> Iterator[Frame]:
    """The same frames; the time spent waiting for them is counted."""
    while True:
        with seconds.measure("decode"):
            frame = next(frames, None)
        if frame is None:
            return
        yield frame


def _held_frames(merged: MergedMaps, config: Config) -> np.ndarray | None:
    """Without fixes in the energy the first frame and one further on hold place and scale."""
    if merged.georeferenced and config.gps.model != "none":
        return None
    poses = merged.scene.poses
    way = np.cumsum(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1))
    second = 1 + int(np.searchsorted(way, 0.02 * way[-1]))
    return np.isin(np.arange(len(poses)), [0, min(second, len(poses) - 1)])


def _solution(
    recording: Recording,
    config: Config,
    origin: GeodeticPoint | None,
    fixes: Fixes,
    merged: MergedMaps,
    smoothed: BatchResult,
    seconds: StageTimer,
    warnings: tuple[str, ...],
) -> Solution:
    kept = np.flatnonzero(np.isfinite(smoothed.sigma_px))
    row_of = np.full(len(smoothed.points), -1)
    row_of[kept] = np.arange(len(kept))
    observations = smoothed.observations
    rotation_sigma, position_sigma = world_sigmas(smoothed.poses, smoothed.covariance)
    t_s, log, sensors = merged.scene.t_s, recording.gps, smoothed.sensors
    antenna, in_time = sensors.camera_p_antenna, fixes.earlier(sensors.time_offset_s)
    table = (
        fix_table(log, in_time, smoothed.assessment, t_s, smoothed.poses, antenna, config) if log else None
    )
    return Solution(
        recording=recording.path,
        world_origin=origin,
        georeferenced=merged.georeferenced,
        t_s=t_s,
        world_T_camera=smoothed.poses,
        sigma_rotation_rad=rotation_sigma,
        sigma_position_m=position_sigma,
        state=merged.state,
        camera=recording.camera,
        camera_p_antenna=antenna,
        landmarks=Landmarks(smoothed.points[kept], smoothed.sigma_px[kept], merged.gray[kept]),
        observations=Observations(observations.frame, row_of[observations.landmark], observations.uv_px),
        gps=log,
        fixes=table,
        sensors=SensorReport(
            sensors.time_offset_s,
            float(smoothed.time_offset_sigma_s[0]),
            tuple(smoothed.antenna_sigma_m.tolist()),
        ),
        report=smoothed.report,
        seconds=dict(seconds.by_stage),
        warnings=warnings,
        config=config.model_dump(mode="json"),
        video_start_utc=recording.rig.video_start_utc,
        world_p_before=merged.scene.poses[:, :3, 3].copy(),
    )

"""The ``Solution`` of a run, put together from the front end, the merged maps and stage D."""

from math import nan

from vgps.config import Config
from vgps.geometry import world_sigmas
from vgps.gps.verdicts import close_calls, contradictions, fix_table, refusals
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.sensor_notes import antenna_notes, clock_notes, upright_notes
from vgps.pipeline.solved_maps import solved_cameras, solved_map
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import FixTable, SensorReport, Solution


def solution_of(front_end: FrontEnd, merged: MergedMaps, batch: BatchResult, config: Config) -> Solution:
    """Return what a run found, with a verdict for every fix and all warnings.

    Args:
        front_end: Result of stages A to C.
        merged: Its maps in one scene, where stage D began.
        batch: Result of stage D.
        config: The settings, which the solution keeps.
    """
    recording, sensors, poses = front_end.recording, batch.sensors, batch.trajectory.world_T_camera
    landmarks, observations = solved_map(merged, batch)
    rotation_sigma, position_sigma = world_sigmas(poses, batch.covariance)
    table = _fix_table(front_end, batch, config)
    return Solution(
        recording=recording.path,
        world_origin=front_end.origin,
        georeferenced=merged.georeferenced,
        t_s=merged.scene.t_s,
        world_T_camera=poses,
        sigma_rotation_rad=rotation_sigma,
        sigma_position_m=position_sigma,
        state=merged.state,
        camera=recording.camera,
        camera_p_antenna=sensors.camera_p_antenna,
        landmarks=landmarks,
        observations=observations,
        gps=recording.gps,
        fixes=table,
        sensors=_sensor_report(front_end, batch, config),
        report=batch.report,
        seconds=front_end.seconds,
        warnings=_warnings(front_end, merged, batch, table, config),
        config=config.model_dump(mode="json"),
        video_start_utc=recording.rig.video_start_utc,
        world_p_before=merged.scene.poses[:, :3, 3].copy(),
        control_points=recording.control_points,
        graph=batch.graph,
        static_regions=front_end.static_regions,
        moving_regions=front_end.moving_regions,
        cameras=solved_cameras(front_end, merged, batch),
    )


def _warnings(
    front_end: FrontEnd, merged: MergedMaps, batch: BatchResult, table: FixTable | None, config: Config
) -> tuple[str, ...]:
    """Return all warnings of a run; those that make the whole result doubtful come first."""
    log = front_end.recording.gps
    contradicted: tuple[str, ...] = ()
    upright: tuple[str, ...] = ()
    if table is not None and log is not None:
        refused = refusals(table, log.fix_class, log.t_s, batch.conflicts)
        contradicted = (*refused, *contradictions(table, log.fix_class))
    if merged.georeferenced:
        upright = upright_notes(batch.trajectory.world_T_camera, config.start)
    return (
        *contradicted,
        *upright,
        *front_end.warnings,
        *merged.warnings,
        *batch.warnings,
        *close_calls(batch.assessment, front_end.fixes.t_s, batch.conflicts),
        *clock_notes(front_end, batch, config.sensors),
        *antenna_notes(front_end, merged, batch, config),
    )


def _sensor_report(front_end: FrontEnd, batch: BatchResult, config: Config) -> SensorReport:
    mount, bias = front_end.recording.rig.imu, batch.imu_bias
    return SensorReport(
        batch.sensors.time_offset_s,
        float(batch.time_offset_sigma_s[0]),
        tuple(batch.antenna_sigma_m.tolist()),
        batch.sensors.clock_rate,
        batch.sensors.clock_rate_sigma or nan,
        config.sensors.video_speed,
        fix_errors={str(name): vars(errors) for name, errors in batch.errors.items()},
        imu={} if bias is None or mount is None else bias.report(mount.imu_R_camera),
    )


def _fix_table(front_end: FrontEnd, batch: BatchResult, config: Config) -> FixTable | None:
    log, sensors = front_end.recording.gps, batch.sensors
    if log is None:
        return None
    corrected = front_end.fixes.on_video_clock(sensors)
    return fix_table(log, corrected, batch.assessment, batch.trajectory, sensors.camera_p_antenna, config)

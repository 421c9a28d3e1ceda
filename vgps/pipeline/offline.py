"""Offline smoothing: stages A to C over the whole video, then D over everything."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.astray_video import astray_note, left_by_the_video
from vgps.gps.fixes import Fixes
from vgps.gps.sky_view import under_sky
from vgps.model import Recording
from vgps.pipeline.airborne import with_airborne
from vgps.pipeline.camera_height import tie_to_ground, with_camera_height
from vgps.pipeline.camera_refinement import moved_far, with_camera, with_found_camera, with_held_guess
from vgps.pipeline.checkpoint import Checkpoint
from vgps.pipeline.even_times import with_even_times
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.gps_clock import with_gps_clock, with_right_clock
from vgps.pipeline.gyro_agreement import with_gyro_focal, with_gyro_note
from vgps.pipeline.imu_agreement import contradiction_note, force_note, imu_agreement, with_imu_clock
from vgps.pipeline.inertial_start import with_inertial_start
from vgps.pipeline.loop_closure import optimise_loops
from vgps.pipeline.readout_estimation import with_contradicted_readout, with_readout
from vgps.pipeline.readout_probe import ReadoutProbe, is_confirmed, readout_probe, with_readout_seen
from vgps.pipeline.rough_solution import is_tied
from vgps.pipeline.run_result import solution_of
from vgps.pipeline.sensor_notes import with_moving_note
from vgps.pipeline.solved_maps import merged_maps
from vgps.pipeline.steady_focal import fits_worse, refuses_more, with_focal_note, with_steady_focal
from vgps.pipeline.turned_camera import with_right_roll
from vgps.pipeline.video_speed import with_right_speed, with_video_speed
from vgps.runtime.progress import NoProgress, Progress
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer, sequential_seconds
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.solution import Solution

_MOST_STEADY_RUNS = 4  # each is as long as the first; a zoom of a tenth took three
_ASTRAY_SHARE = 0.05  # a camera that a run has found is off by more only if that run went astray


def smooth(
    recording: Recording,
    config: Config | None = None,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
) -> Solution:
    """Return the pose of every frame of a recording, in world coordinates.

    Args:
        recording: From :func:`vgps.open_recording`.
        config: Settings; the defaults if none are given.
        progress: Progress display.
        checkpoint: Where the stages are kept, and resumed from.

    Raises:
        VgpsError: The recording does not determine the poses.
    """
    config, progress = with_airborne(recording, config or Config()), progress or NoProgress()
    timer = StageTimer()
    with timer.measure("all"):
        recording = with_found_camera(with_video_speed(recording, config), config, progress)
        probe = readout_probe(recording, config)
        solution, run = _smoothed(_Run(recording, config), progress, checkpoint, probe)
        for share in (config.camera_calibration.restart_share, _ASTRAY_SHARE, _ASTRAY_SHARE):
            better = _better(run, solution, share)
            if better.recording is run.recording:
                break
            try:
                solution, run = _smoothed(better, progress)
            except (GeometryError, np.linalg.LinAlgError) as error:  # the run before had a path
                note = f"another run with what this one shows of the camera gave no path: {error}"
                solution = replace(solution, warnings=(*solution.warnings, note))
                break
        solution = _with_one_focal_length(solution, run, progress)
        solution = _with_believed_fixes(solution, run, progress)
    # a resumed run has the seconds of stages that an earlier process ran
    rest_s = max(timer.by_stage["all"] - sequential_seconds(solution.seconds), 0.0)
    seconds = {**solution.seconds, "rest": rest_s}
    solution = replace(solution, config=config.model_dump(mode="json"), seconds=seconds)
    return with_focal_note(with_moving_note(with_gyro_note(solution, recording)))


@dataclass(frozen=True)
class _Run:
    """What a run is made of."""

    recording: Recording
    config: Config


def _better(run: _Run, solution: Solution, share: float) -> _Run:
    """Return what another run deserves, or the same if there is no need of one.

    Stages A to C run again with a camera that is by more than a share from the guess, or a rolling shutter
    found after them.
    """
    better, found_s = run.recording, solution.camera.readout_s
    if run.recording.guesses:
        refined = with_gyro_focal(run.recording, solution)
        better = refined if moved_far(refined.camera, better.camera, share) else better
    if not found_s or run.recording.camera.readout_s is not None:
        return _Run(better, run.config)
    return _Run(*with_readout_seen(better, run.config, found_s))


def _with_one_focal_length(solution: Solution, run: _Run, progress: Progress) -> Solution:
    """Return the solution of runs with pictures of one focal length, until they show no changes of it.

    Maps made with a wrong focal length show only a part of its changes.
    """
    first = best = solution
    for _ in range(_MOST_STEADY_RUNS):
        recording = with_steady_focal(run.recording, solution)
        if recording is run.recording:
            break
        progress.stage("again with pictures scaled to one focal length, which changes")
        try:
            solution, run = _smoothed(_Run(recording, run.config), progress)
        except (GeometryError, np.linalg.LinAlgError):  # the run before had a path
            break
        if not refuses_more(solution, best):
            best = solution
    return first if best is not first and fits_worse(best, first) else best


def _with_believed_fixes(solution: Solution, run: _Run, progress: Progress) -> Solution:
    """Return the solution of a run that refuses no fix if this one's video went astray from some."""
    log, table = solution.gps, solution.fixes
    if log is None or table is None:
        return solution
    left = left_by_the_video(table, log.fix_class, log.t_s)
    if not len(left):
        return solution
    progress.stage("again with all fixes believed, as the video went astray")
    outliers = run.config.outliers.model_copy(update={"enabled": False})
    believing = run.config.model_copy(update={"outliers": outliers})
    try:
        again, _ = _smoothed(_Run(run.recording, believing), progress)
    except (GeometryError, np.linalg.LinAlgError):  # the run before had a path
        return solution
    return replace(again, warnings=(astray_note(left, table, log.t_s), *again.warnings))


def _smoothed(
    run: _Run, progress: Progress, checkpoint: Checkpoint | None = None, probe: ReadoutProbe | None = None
) -> tuple[Solution, _Run]:
    """Return the solution and its run: one with a rolling shutter if the first frames show it."""
    recording, config = run.recording, run.config
    front_end = run_front_end(recording, config, progress, checkpoint, probe)  # stages A, B and C
    if probe is not None and probe.found is not None:
        progress.stage("from the first frame again, with the rolling shutter that was seen")
        with suppress(GeometryError, np.linalg.LinAlgError):  # one that is not there may leave no path
            rolling = _smoothed(_Run(*with_readout_seen(recording, config, probe.found.readout_s)), progress)
            if is_confirmed(rolling[0], config):
                return rolling
        return _smoothed(run, progress)
    journal = None if checkpoint is None else checkpoint.journal
    front_end, config = with_even_times(front_end, config, progress)
    front_end = with_inertial_start(replace(front_end, journal=journal), config, progress)
    front_end, config = with_right_speed(front_end, config, progress)
    front_end, config = with_right_clock(front_end, config, progress)
    front_end, config = with_right_roll(front_end, config, progress)
    recording = front_end.recording
    was = run.recording
    if config is not run.config or recording.camera is not was.camera or recording.video is not was.video:
        run = _Run(recording, config)
    found = imu_agreement(front_end, config, progress)
    if found.misled and found.contradiction is None:
        progress.stage("again with the IMU's clock as the video shows it")
        recording = with_imu_clock(recording, found)
        front_end = with_inertial_start(run_front_end(recording, config, progress), config, progress)
        found = imu_agreement(front_end, config, progress)
    if (wrong := contradiction_note(front_end, found)) is not None:
        progress.stage("again without the IMU, which contradicts the video")
        recording = replace(recording, imu=None, notes=(*recording.notes, wrong))
        front_end = run_front_end(recording, config, progress)
    shifted = with_imu_clock(front_end.recording, found)
    notes = shifted.notes[len(front_end.recording.notes) :]
    warnings = (*front_end.warnings, *notes)
    front_end = replace(front_end, recording=shifted, warnings=warnings, journal=journal)
    progress.stage("optimising everything (D)")
    return optimise_all(front_end, config, progress), run


def optimise_all(front_end: FrontEnd, config: Config, progress: Progress | None = None) -> Solution:
    """Run stage D: merge the maps, optimise everything, close loops, and return the solution.

    Raises:
        GeometryError: No step lowers the cost.
    """
    front_end = with_gps_clock(front_end, config)
    timer = StageTimer(dict(front_end.seconds))
    with one_blas_thread(), timer.measure("batch"):
        merged = merged_maps(front_end, front_end.context(config))
        merged = tie_to_ground(front_end, merged, config)
        front_end = _with_right_forces(front_end, merged, config)
        fixes = _under_sky(front_end, merged, config)
        (batch, refined, readout), loops = optimise_loops(
            front_end, merged, fixes, config, progress or NoProgress()
        )
    finished = replace(front_end, fixes=fixes, seconds=timer.by_stage)
    solution = replace(solution_of(finished, merged, batch, config), loops=loops)
    solution = with_camera_height(solution, merged, batch)
    if refined is not None:
        solution = with_camera(solution, refined, front_end.recording)
    elif front_end.recording.guesses:
        solution = with_held_guess(solution, front_end.recording)
    if readout is not None:
        return with_readout(solution, readout, batch.readout_s, config)
    return with_contradicted_readout(solution, batch, front_end, config)


def _with_right_forces(front_end: FrontEnd, merged: MergedMaps, config: Config) -> FrontEnd:
    """Return the front end without the IMU, and with a warning, if its accelerometer would bend the path.

    Where nothing ties the path to the world, its frame has no vertical and no metre for the accelerometer.
    """
    recording = front_end.recording
    if recording.imu is None or config.imu.use == "no":
        return front_end
    if not is_tied(front_end, merged, config):
        note = (
            f"{recording.imu.source.name} only predicted rotations: without fixes or control points the path "
            "has no vertical and no scale to compare with gravity and accelerations"
        )
    elif (confused := force_note(front_end, merged.scene.trajectory, config)) is not None:
        note = confused
    else:
        return front_end
    warnings = (*front_end.warnings, note)
    return replace(front_end, recording=replace(recording, imu=None), warnings=warnings)


def _under_sky(front_end: FrontEnd, merged: MergedMaps, config: Config) -> Fixes:
    """Return the fixes, with larger regions where the scene hides the sky if the settings ask for it.

    Those of a run that is not in the world are not used.
    """
    log, scene = front_end.recording.gps, merged.scene
    if log is None or not merged.georeferenced:
        return replace(front_end.fixes, used=np.zeros_like(front_end.fixes.used))
    return under_sky(
        front_end.fixes, scene.trajectory, scene.points, front_end.sensors, log.satellites, config.gps
    )

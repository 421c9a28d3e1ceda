"""Stage D, Kume 2010: batch optimisation of all poses and features by Levenberg-Marquardt."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from vgps.config import BatchConfig, Config
from vgps.errors import GeometryError
from vgps.gps.antenna_path import antenna_offsets, antenna_velocities, place
from vgps.gps.fix_conflict import with_conflict_verdicts
from vgps.gps.fixes import Fixes
from vgps.gps.learned_errors import LearnedErrors, largest_errors, learn_errors
from vgps.gps.outlier_detection import FixAssessment, assess_offsets, detects_outliers
from vgps.gps.sensors import Sensors
from vgps.imu.states import ImuStates
from vgps.model import BoolArray, FixClass, FloatArray
from vgps.smoothing.calibration.mount_refinement import mount_notes, refine_mounts
from vgps.smoothing.calibration.readout import with_better_readout
from vgps.smoothing.context import RigMount, SmoothingContext
from vgps.smoothing.scene.control_factors import control_sigma_px
from vgps.smoothing.scene.factor_graph import select_observations
from vgps.smoothing.scene.frame_rates import frame_rates
from vgps.smoothing.scene.ground import find_ground, terrain
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.scene.triangulation import triangulated
from vgps.smoothing.stage_d.batch_problem import BatchInput, batch_problem
from vgps.smoothing.stage_d.batch_result import BatchResult, BatchSolution, batch_result, report_with_warnings
from vgps.smoothing.stage_d.clock_check import with_certain_clock, with_shown_clock
from vgps.smoothing.stage_d.fix_conflicts import find_conflicts, with_conflicts
from vgps.smoothing.stage_d.imu_states import start_imu
from vgps.smoothing.stage_d.lever_arm_check import with_possible_antenna
from vgps.smoothing.stage_d.long_steps import solve_once
from vgps.smoothing.stage_d.rounds import Stage, stages
from vgps.smoothing.stage_d.variance_components import balanced_sigma_scale
from vgps.solution import Observations, Trajectory
from vgps.solver.bundle_adjustment import BundleResult, SolverSettings

_EARLY_DECREASE = 0.1  # of the cost that ends an early round: a move of 0.45 standard deviations
_FIRST_DAMPING = 1e-9  # the scale of a video without fixes drifts along directions this weak


def optimise_batch(
    scene: Scene,
    fixes: Fixes,
    sensors: Sensors,
    context: SmoothingContext,
    fixed: BoolArray | None = None,
    assessment: FixAssessment | None = None,
) -> BatchResult:
    """Minimise the energy (11) over all poses and features, in a few rounds.

    Between rounds, observations are selected and fixes assessed again, features without a valid position are
    triangulated again (19), and reliabilities (13) recomputed. The first round raises the exponent of the GPS
    walls in stages, and bounds offsets loosely; noise and walk of the fixes' errors follow from its path.

    Args:
        scene: All frames, posed, and all features with their observations.
        fixes: All fixes, at the times of their time stamps.
        sensors: Initial time offset and lever arm, and whether they are estimated with the poses.
        context: Calibration, weights, rounds and GPS model.
        fixed: (F,) frames to hold, where no fix ties the scene to the world.
        assessment: Initial assessment of the fixes.

    Raises:
        GeometryError: No step lowers the cost of a start that is no minimum.
    """
    config = context.config
    assessment = assessment or FixAssessment.unassessed(len(fixes))
    iterations, given = 0, context.cameras
    errors = largest_errors(config.gps) if config.batch.rounds > 1 else {}
    if context.rough:
        sensors = with_certain_clock(sensors, assessment.applied(fixes), config)
    state = _State(scene, sensors, assessment, context, errors, start_imu(scene, context))
    if config.start.flies:
        state = _with_ground(state, scene.observations, fixed)
    *earlier, last = stages(config)
    for stage in earlier:
        state, solved = _solve_with_clock(state, fixes, fixed, stage)
        state, iterations = state.after(solved.result), iterations + solved.result.report.iterations
        if stage.ends_round:
            context, state = _with_rows(context, state, solved)
            context, state = _with_mounts(context, state, solved, given)
            state = _with_ground(state, solved.given.scene.observations, fixed)
            state = _reassess(state, fixes, solved.given.sigma_px, context)
            if stage.first:
                state = _with_fix_errors(state, fixes)
        del solved  # its observations, before the next stage selects its own
    solved = _solve_stage(state, fixes, fixed, last)
    state, iterations = state.after(solved.result), iterations + solved.result.report.iterations
    if conflicts := find_conflicts(solved, fixes, state.assessment):
        state = replace(state, assessment=with_conflict_verdicts(state.assessment, conflicts, fixes))
        solved = _solve_stage(state, fixes, fixed, last)
        state, iterations = state.after(solved.result), iterations + solved.result.report.iterations
    sensors = with_possible_antenna(state.sensors, solved.given, solved.result.problem)
    if sensors is not state.sensors:
        state = _reassess(replace(state, sensors=sensors), fixes, solved.given.sigma_px, context)
        solved = _solve_stage(state, fixes, fixed, last)
        state, iterations = state.after(solved.result), iterations + solved.result.report.iterations
    report, warnings = report_with_warnings(scene, solved.result, iterations)
    result = batch_result(solved, state.assessment, state.sensors, report, context)
    notes = (*warnings, *result.warnings, *mount_notes(context.cameras, given))
    return with_conflicts(replace(result, warnings=notes), conflicts)


@dataclass(frozen=True)
class _State:
    """State after the rounds so far.

    The settings in ``context`` include the current weight of the video; ``errors`` replace those of the
    classes.
    """

    scene: Scene
    sensors: Sensors
    assessment: FixAssessment
    context: SmoothingContext
    errors: Mapping[FixClass, LearnedErrors]
    imu: ImuStates | None = None

    def after(self, result: BundleResult) -> "_State":
        """Return the state with the poses, points and sensors of a solution."""
        problem = result.problem
        scene = replace(self.scene, poses=problem.world_T_camera, points=problem.world_p_landmark)
        vectors = {key: state.vector for key, state in problem.states.items()}
        imu = None if self.imu is None else self.imu.moved(vectors)
        return replace(self, scene=scene, sensors=self.sensors.moved(problem.shared), imu=imu)

    def usable(self, fixes: Fixes) -> Fixes:
        """Return the fixes with their verdicts applied, at the times of their positions."""
        return self.assessment.applied(fixes).on_video_clock(self.sensors)


def _with_fix_errors(state: _State, fixes: Fixes) -> _State:
    """Return the state with the noise and the walk of the fixes' errors learned from the path."""
    antenna, config, scene = state.sensors.camera_p_antenna, state.context.config, state.scene
    torn = scene.torn(config.tracking.min_inliers)
    errors = learn_errors(state.usable(fixes), scene.trajectory, torn, antenna, config)
    return replace(state, errors=errors)


def _with_rows(
    context: SmoothingContext, state: _State, solved: BatchSolution
) -> tuple[SmoothingContext, _State]:
    """Return the readout and the frames' rates of a rolling shutter as a round shows them."""
    problem = solved.result.problem
    if problem.row_times is None or problem.mounts is not None:
        return context, state
    rates = frame_rates(problem, state.scene.rates)
    as_seen = replace(problem, uv_px=solved.given.scene.observations.uv_px)
    context = with_better_readout(context, as_seen, state.scene.t_s)
    return context, replace(state, scene=replace(state.scene, rates=rates))


def _with_ground(state: _State, seen: Observations, fixed: BoolArray | None) -> _State:
    """Return the state with the ground under its path, unless held frames level it."""
    scene, kind = state.scene, terrain(state.context.config.start)
    if fixed is not None and fixed.any():
        return state
    ground = find_ground(scene.trajectory, scene.points, seen, kind)
    return replace(state, scene=replace(scene, ground=ground))


def _with_mounts(
    context: SmoothingContext, state: _State, solved: BatchSolution, given: tuple[RigMount, ...]
) -> tuple[SmoothingContext, _State]:
    """Return the poses of a rig's cameras on it as a round shows them, and the scene that follows."""
    cameras, step = refine_mounts(context.cameras, solved.result.problem, given)
    if step is None:
        return context, state
    scene = replace(state.scene, poses=step.poses, points=step.points)
    return replace(context, cameras=cameras), replace(state, scene=scene)


def _solve_stage(state: _State, fixes: Fixes, fixed: BoolArray | None, stage: Stage) -> BatchSolution:
    """Build and solve the problem of a stage."""
    context, batch = state.context, state.context.config.batch
    scene, sigma = select_observations(state.scene, context, batch.first_tolerance if stage.first else 1.0)
    if context.config.submaps.frames_of(len(scene.t_s)) is not None:
        scene = scene.on_disk()
    sensors = state.sensors
    if context.config.gps.has_memory and not sensors.shown_by_poses:
        sensors = sensors.holding_time_offset()
    usable = state.usable(fixes)
    given = BatchInput(
        scene=scene,
        sigma_px=sigma,
        control_sigma_px=control_sigma_px(
            scene.controls, scene.poses, context.K, context.config.start.control_sigma_px
        ),
        fixes=usable,
        sensors=sensors,
        fixed=fixed,
        context=context,
        errors=state.errors,
        imu=state.imu,
        antenna_velocity=antenna_velocities(scene.trajectory, usable.t_s, sensors.camera_p_antenna),
    )
    built = batch_problem(given, stage.n, loose=stage.first and not stage.last)
    result = solve_once(built.problem, _settings(batch, stage.last), batch.solver, context.journal)
    if result.stuck and stage.first:
        raise GeometryError(
            f"the optimiser made no step: {result.report.stop_reason}",
            remedy="check the camera's calibration, the GPS log and their clocks",
        )
    return BatchSolution(given, built, result)


def _solve_with_clock(
    state: _State, fixes: Fixes, fixed: BoolArray | None, stage: Stage
) -> tuple[_State, BatchSolution]:
    """Solve a stage; the end of the first round decides whether the poses determine the time offset."""
    solved = _solve_stage(state, fixes, fixed, stage)
    if not (stage.first and stage.ends_round):
        return state, solved

    def again(sensors: Sensors) -> BatchSolution:
        return _solve_stage(replace(state, sensors=sensors), fixes, fixed, stage)

    sensors, solved = with_shown_clock(state.sensors, solved, again)
    return replace(state, sensors=sensors), solved


def _reassess(state: _State, fixes: Fixes, sigma_px: FloatArray, given: SmoothingContext) -> _State:
    """Return the state with features, verdicts and weights updated for the improved poses."""
    scene = triangulated(state.scene, np.isnan(sigma_px), given, given.config.mapping.min_views)
    corrected = fixes.on_video_clock(state.sensors)
    assessment = state.assessment.updated(_assess(scene, corrected, state.sensors, given.config))
    scale = balanced_sigma_scale(
        given.config,
        state.context.config.batch.video_sigma_scale,
        scene.trajectory,
        assessment.applied(corrected),
        state.sensors.camera_p_antenna,
    )
    batch = given.config.batch.model_copy(update={"video_sigma_scale": scale})
    weighted = replace(given, config=given.config.model_copy(update={"batch": batch}))
    return replace(state, scene=scene, assessment=assessment, context=weighted)


def _assess(scene: Scene, fixes: Fixes, sensors: Sensors, config: Config) -> FixAssessment:
    inside = fixes.used & place(scene.t_s, fixes.t_s).inside
    if not detects_outliers(config) or not inside.any():
        return FixAssessment.unassessed(len(fixes))
    offset = antenna_offsets(fixes, Trajectory(scene.t_s, scene.poses), sensors.camera_p_antenna)
    offset[~inside] = np.nan
    return assess_offsets(offset, fixes, config)


def _settings(config: BatchConfig, last: bool) -> SolverSettings:
    if last:
        return SolverSettings(
            max_iterations=2 * config.iterations,
            relative_tolerance=config.relative_tolerance,
            lambda_start=_FIRST_DAMPING,
        )
    return SolverSettings(
        max_iterations=config.iterations,
        relative_tolerance=config.early_tolerance,
        absolute_tolerance=_EARLY_DECREASE,
        lambda_start=_FIRST_DAMPING,
    )

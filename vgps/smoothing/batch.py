"""Stage D, Kume 2010: everything at once, reliabilities included, by batch Levenberg-Marquardt."""

from dataclasses import dataclass, replace

import numpy as np

from factors import exponent_schedule
from vgps.config import BatchConfig, Config
from vgps.errors import GeometryError
from vgps.geometry import triangulate
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.gps.outlier_detection import FixAssessment, assess_offsets, detects_outliers
from vgps.gps.sensors import Sensors
from vgps.gps.time_offset import update_time_offset
from vgps.model import BoolArray, FloatArray
from vgps.smoothing.batch_result import BatchResult, SolvedBatch, batch_result, report_of
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.factor_graph import (
    Scene,
    build_problem,
    gps_and_motion,
    select_observations,
)
from vgps.smoothing.variance_components import balanced
from vgps.solver.bundle_adjustment import BundleResult, SolverSettings, solve


def optimise_batch(
    scene: Scene,
    fixes: Fixes,
    sensors: Sensors,
    context: SmoothingContext,
    fixed: BoolArray | None = None,
    assessment: FixAssessment | None = None,
) -> BatchResult:
    """Minimise the energy (11) over all poses and features, in a few rounds.

    Between rounds observations and fixes are assessed anew, features that lost their position are
    triangulated again (19), and reliabilities (13) recomputed. The first round raises the exponent of the GPS
    walls in stages.

    Args:
        scene: All frames, posed, and all features with their observations.
        fixes: All fixes, by their own clock.
        sensors: Time offset and lever arm to begin with, and whether they are estimated with the poses.
        context: Calibration, weights, rounds and GPS model.
        fixed: (F,) frames to hold, where no fix ties the scene.
        assessment: Of the fixes, to begin with.

    Raises:
        GeometryError: No step lowers the cost of a start that is no minimum.
    """
    config = context.config
    estimate = _Estimate(scene, sensors, assessment or FixAssessment.unassessed(len(fixes)), context)
    rounds, iterations = config.batch.rounds, 0
    remark: tuple[str, ...] = ()
    for round_ in range(rounds):
        if round_ == 1:  # maps that were only just merged show time offsets that are none
            estimate, remark = _with_time_offset(estimate, fixes)
        for n in exponent_schedule(config.gps.n) if round_ == 0 else [config.gps.n]:
            solved = _solve_round(estimate, fixes, fixed, _Round(round_ == 0, round_ == rounds - 1, n))
            estimate = estimate.after(solved.result)
            iterations += solved.result.report.iterations
        if round_ < rounds - 1:
            estimate = _reassessed(estimate, fixes, solved.sigma_px, context)
    report, warnings = report_of(scene, solved.result, iterations)
    found = estimate.assessment, estimate.sensors
    result = batch_result(solved, estimate.believed(fixes), *found, report, context)
    return replace(result, warnings=(*remark, *warnings, *result.warnings))


@dataclass(frozen=True)
class _Round:
    """Which round it is, and the exponent of the GPS walls."""

    first: bool
    last: bool
    n: int


@dataclass(frozen=True)
class _Estimate:
    """What the rounds have found so far; ``context`` carries the video's weight."""

    scene: Scene
    sensors: Sensors
    assessment: FixAssessment
    context: SmoothingContext

    def after(self, result: BundleResult) -> "_Estimate":
        """Return the estimate with what a solver found."""
        problem = result.problem
        scene = replace(self.scene, poses=problem.world_T_camera, points=problem.world_p_landmark)
        return replace(self, scene=scene, sensors=self.sensors.moved(problem.shared))

    def believed(self, fixes: Fixes) -> Fixes:
        """Return the fixes as they are assessed, in time."""
        return self.assessment.applied(fixes).earlier(self.sensors.time_offset_s)


def _with_time_offset(estimate: _Estimate, fixes: Fixes) -> tuple[_Estimate, tuple[str, ...]]:
    """Return the estimate with the time offset that the fixes show, and remarks."""
    believed, config = estimate.assessment.applied(fixes), estimate.context.config.sensors
    sensors, remark = update_time_offset(estimate.sensors, estimate.scene.trajectory, believed, config)
    return replace(estimate, sensors=sensors), remark


def _solve_round(estimate: _Estimate, fixes: Fixes, fixed: BoolArray | None, round_: _Round) -> SolvedBatch:
    """Build and solve the problem of a round."""
    context, batch = estimate.context, estimate.context.config.batch
    kept, sigma = select_observations(estimate.scene, context, batch.first_tolerance if round_.first else 1.0)
    in_time, sensors = estimate.believed(fixes), estimate.sensors
    graph = gps_and_motion(kept, in_time, sensors, context, round_.n)
    problem = build_problem(kept, np.nan_to_num(sigma, nan=1.0), graph, context, fixed, sensors.shared())
    result = solve(problem, _settings(batch, round_.last), batch.solver)
    if result.stuck and round_.first:
        raise GeometryError(
            f"the optimiser made no step: {result.report.stop_reason}",
            remedy="check the camera's calibration, the GPS log and their clocks",
        )
    return SolvedBatch(result=result, kept=kept, sigma_px=sigma, fixes=in_time, sensors=sensors)


def _reassessed(
    estimate: _Estimate, fixes: Fixes, sigma_px: FloatArray, given: SmoothingContext
) -> _Estimate:
    """Return the estimate with features, verdicts and weights as the improved poses have them."""
    scene = _retriangulated(estimate.scene, sigma_px, given)
    in_time = fixes.earlier(estimate.sensors.time_offset_s)
    found = _assessed(scene, in_time, estimate.sensors, given.config)
    assessment = estimate.assessment.updated(found)
    scale = balanced(
        given.config,
        estimate.context.config.batch.video_sigma_scale,
        scene.trajectory,
        assessment.applied(in_time),
        estimate.sensors.camera_p_antenna,
    )
    batch = given.config.batch.model_copy(update={"video_sigma_scale": scale})
    weighted = replace(given, config=given.config.model_copy(update={"batch": batch}))
    return _Estimate(scene, estimate.sensors, assessment, weighted)


def _assessed(scene: Scene, fixes: Fixes, sensors: Sensors, config: Config) -> FixAssessment:
    placement = place(scene.t_s, fixes.t_s)
    inside = fixes.used & placement.inside
    if not detects_outliers(config) or not inside.any():
        return FixAssessment.unassessed(len(fixes))
    offset = antenna_at(scene.poses, placement, sensors.camera_p_antenna) - fixes.world_p_fix
    offset[~inside] = np.nan
    return assess_offsets(offset, fixes, config)


def _settings(config: BatchConfig, last: bool) -> SolverSettings:
    if last:
        tolerance, iterations = config.relative_tolerance, 2 * config.iterations
    else:
        tolerance, iterations = config.early_tolerance, config.iterations
    return SolverSettings(max_iterations=iterations, relative_tolerance=tolerance)


def _retriangulated(scene: Scene, sigma_px: FloatArray, context: SmoothingContext) -> Scene:
    """Triangulate features that were left out (NaN in ``sigma_px``) anew from the improved poses."""
    min_views = context.config.mapping.min_views
    out = np.isnan(sigma_px)
    rows = np.flatnonzero(out[scene.observations.landmark])
    rows = rows[np.argsort(scene.observations.landmark[rows], kind="stable")]
    landmark, start, count = np.unique(
        scene.observations.landmark[rows], return_index=True, return_counts=True
    )
    if len(landmark) == 0:
        return scene
    enough = np.repeat(count, count) >= min_views
    rows, landmark = rows[enough], landmark[count >= min_views]
    start = np.searchsorted(scene.observations.landmark[rows], landmark)
    if len(landmark) == 0:
        return scene
    found, _ = triangulate(
        context.K, scene.poses[scene.observations.frame[rows]], scene.observations.uv_px[rows], start
    )
    points = scene.points.copy()
    points[landmark] = found
    return replace(scene, points=points)

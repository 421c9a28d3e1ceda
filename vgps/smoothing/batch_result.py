"""Result of stage D: the last problem's solution, with standard deviations and a report."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.fixes import Fixes, contributing_fixes, gps_graph
from vgps.gps.outlier_detection import FixAssessment
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors
from vgps.model import FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.covariance import ErrorSources, drawn_covariances
from vgps.smoothing.factor_graph import Scene, other_pose_factors
from vgps.smoothing.variance_components import variance_factor
from vgps.solution import Observations, SolverReport, Trajectory
from vgps.solver.bundle_adjustment import BundleResult
from vgps.solver.cost import cost_terms
from vgps.solver.marginals import Covariances
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True, kw_only=True)
class BatchResult:
    """What stage D found.

    Attributes:
        trajectory: Poses of all frames.
        covariance: (F, 6, 6) of the poses in the camera's tangent [rotation; translation], NaN if the system
            does not determine them.
        points: (L, 3) features.
        sigma_px: (L,) their reliabilities, NaN for features that were left out.
        observations: Those that took part.
        assessment: Of the fixes.
        sensors: Time offset and lever arm, estimated or as they were.
        time_offset_sigma_s: (1,) its standard deviation, NaN if it was not estimated.
        antenna_sigma_m: (3,) standard deviations of the lever arm, NaN if it was not estimated.
        report: Cost per term before and after, iterations, why it stopped.
        warnings: In words.
        problem: What was solved last, at its end.
    """

    trajectory: Trajectory
    covariance: FloatArray
    points: FloatArray
    sigma_px: FloatArray
    observations: Observations
    assessment: FixAssessment
    sensors: Sensors
    time_offset_sigma_s: FloatArray
    antenna_sigma_m: FloatArray
    report: SolverReport
    warnings: tuple[str, ...]
    problem: BundleProblem


@dataclass(frozen=True, kw_only=True)
class SolvedBatch:
    """The solution of a problem of stage D, and what the problem was built from.

    Attributes:
        result: The solution.
        kept: The scene with the observations that took part.
        sigma_px: (L,) reliabilities of all features, NaN for those that were left out.
        fixes: In time.
        sensors: As they were before.
    """

    result: BundleResult
    kept: Scene
    sigma_px: FloatArray
    fixes: Fixes
    sensors: Sensors


def batch_result(
    solved: SolvedBatch,
    believed: Fixes,
    assessment: FixAssessment,
    sensors: Sensors,
    report: SolverReport,
    context: SmoothingContext,
) -> BatchResult:
    """Return the solution of the last problem with its standard deviations.

    Args:
        solved: The last problem.
        believed: All fixes as they are assessed, in time.
        assessment: Of all fixes.
        sensors: As they were found.
        report: Of the optimiser.
        context: Calibration, weights and GPS model.
    """
    after = solved.result.problem
    path = Trajectory(solved.kept.t_s, after.world_T_camera)
    covariance, warnings = _covariance(solved, context)
    # what all tracks have in common shows in no track, but in fixes that fit worse than their regions say
    factor = variance_factor(context.config, path, believed, sensors.camera_p_antenna)
    covariance = covariance.scaled(factor)
    return BatchResult(
        trajectory=path,
        covariance=covariance.poses,
        points=after.world_p_landmark,
        sigma_px=solved.sigma_px,
        observations=solved.kept.observations,
        assessment=assessment,
        sensors=sensors,
        time_offset_sigma_s=_sigma(covariance, TIME_OFFSET, sensors.prior_time_offset.sigma_s == 0.0),
        antenna_sigma_m=_sigma(covariance, ANTENNA, sensors.antenna_sigma_m == 0.0),
        report=report,
        warnings=warnings,
        problem=after,
    )


def report_of(start: Scene, result: BundleResult, iterations: int) -> tuple[SolverReport, tuple[str, ...]]:
    """Return the costs of the final problem at the start of D and at its end, and warnings about them."""
    after, reason = result.problem, result.report.stop_reason
    before = cost_terms(replace(after, world_T_camera=start.poses, world_p_landmark=start.points))
    cost_after = cost_terms(after)
    warnings: list[str] = []
    if sum(cost_after.values()) > sum(before.values()):
        warnings += ["stage D ended at a higher cost than it began with, after outliers had been dropped"]
    if not result.converged:
        warnings += [f"stage D did not reach a minimum: {reason}"]
    return SolverReport(before, cost_after, iterations, reason), tuple(warnings)


def _covariance(solved: SolvedBatch, context: SmoothingContext) -> tuple[Covariances, tuple[str, ...]]:
    """Return the covariances at the optimum, NaN with a warning where the system does not give them."""
    scene, fixes, config = solved.kept, solved.fixes, context.config
    sources = ErrorSources(
        gps_graph(fixes, scene.t_s, solved.sensors, config.gps),
        other_pose_factors(scene, solved.sensors, context),
        fixes.where(contributing_fixes(fixes, scene.t_s, config.gps)),
    )
    try:
        return drawn_covariances(solved.result.problem, sources, config.batch.draws, config.seed), ()
    except GeometryError as error:
        unknown = np.full((len(scene.t_s), 6, 6), np.nan)
        return Covariances(unknown, {}), (f"no standard deviations: {error}",)


def _sigma(covariance: Covariances, key: int, held: bool) -> FloatArray:
    """Return the standard deviations of a shared vector, NaN if it was not estimated."""
    if key not in covariance.shared or held:
        return np.full(3 if key == ANTENNA else 1, np.nan)
    return np.asarray(np.sqrt(np.diagonal(covariance.shared[key])))

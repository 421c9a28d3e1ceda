"""What stage D found: the last problem's outcome, with standard deviations and a report."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.fixes import Fixes, gps_graph, taking_part
from vgps.gps.outlier_detection import FixAssessment
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors
from vgps.model import FloatArray
from vgps.smoothing.covariance import ErrorSources, drawn_covariances
from vgps.smoothing.factor_graph import Scene, other_pose_factors
from vgps.smoothing.variance_components import variance_factor
from vgps.solution import Observations, SolverReport
from vgps.solver.bundle_adjustment import BundleResult
from vgps.solver.cost import cost_terms
from vgps.solver.marginals import Covariances
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True)
class BatchResult:
    """What stage D found.

    Attributes:
        poses: (F, 4, 4) and their ``covariance`` (F, 6, 6) in the camera's tangent [rotation; translation],
            NaN if the system does not determine them.
        points: (L, 3) and reliabilities ``sigma_px`` (L,), NaN for features that were left out.
        observations: Those that took part.
        assessment: Of the fixes.
        sensors: Time offset and lever arm, estimated or as they were.
        time_offset_sigma_s: (1,), ``antenna_sigma_m`` (3,): their standard deviations, NaN where not
            estimated.
        report: Cost per term before and after, iterations, why it stopped.
        warnings: In words.
        problem: What was solved last, at its end.
    """

    poses: FloatArray
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


@dataclass(frozen=True)
class SolvedBatch:
    """A problem solved, and what it was built from: the observations that took part and the reliabilities of
    all features, the fixes, the sensors as they were before."""

    result: BundleResult
    kept: Scene
    sigma: FloatArray
    fixes: Fixes
    sensors: Sensors


def smoothed(
    solved: SolvedBatch,
    K: FloatArray,
    fixes: Fixes,
    assessment: FixAssessment,
    sensors: Sensors,
    config: Config,
    report: SolverReport,
    warnings: tuple[str, ...],
) -> BatchResult:
    """The last problem's outcome with its standard deviations.

    Args:
        solved: The last problem.
        K: (3, 3).
        fixes: All of them, by their own clock; ``assessment`` of them.
        sensors: As they were found.
        config: Weights and GPS model.
        report, warnings: What was said on the way.
    """
    after = solved.result.problem
    covariance, doubts = _covariance(after, solved.kept, K, solved.fixes, solved.sensors, config)
    # what all tracks have in common shows in no track, but in fixes that fit worse than their regions say
    believed, antenna = assessment.applied(fixes).earlier(sensors.time_offset_s), sensors.camera_p_antenna
    t_s = solved.kept.t_s
    covariance = covariance.scaled(variance_factor(config, after.world_T_camera, t_s, believed, antenna))
    return BatchResult(
        after.world_T_camera,
        covariance.poses,
        after.world_p_landmark,
        solved.sigma,
        solved.kept.observations,
        assessment,
        sensors,
        _sigma(covariance, TIME_OFFSET, sensors.prior_time_offset.sigma_s == 0.0),
        _sigma(covariance, ANTENNA, sensors.antenna_sigma_m == 0.0),
        report,
        (*warnings, *doubts),
        after,
    )


def report_of(start: Scene, result: BundleResult, iterations: int) -> tuple[SolverReport, tuple[str, ...]]:
    """Costs of the final problem at the start of D and at its end, and what is wrong with them."""
    after, reason = result.problem, result.report.stop_reason
    before = cost_terms(replace(after, world_T_camera=start.poses, world_p_landmark=start.points))
    cost_after = cost_terms(after)
    warnings: list[str] = []
    if sum(cost_after.values()) > sum(before.values()):
        warnings += ["stage D ended at a higher cost than it began with, after outliers had been dropped"]
    if not result.converged:
        warnings += [f"stage D did not reach a minimum: {reason}"]
    return SolverReport(before, cost_after, iterations, reason), tuple(warnings)


def _covariance(
    problem: BundleProblem, scene: Scene, K: FloatArray, fixes: Fixes, sensors: Sensors, config: Config
) -> tuple[Covariances, tuple[str, ...]]:
    """Of the optimum of ``problem``, which was built from the rest."""
    sources = ErrorSources(
        gps_graph(fixes, scene.t_s, sensors, config.gps),
        other_pose_factors(scene, K, sensors, config),
        fixes.where(taking_part(fixes, scene.t_s, config.gps)),
    )
    try:
        return drawn_covariances(problem, sources, config.batch.draws, config.seed), ()
    except GeometryError as error:
        unknown = np.full((len(problem.world_T_camera), 6, 6), np.nan)
        return Covariances(unknown, {}), (f"no standard deviations: {error}",)


def _sigma(covariance: Covariances, key: int, held: bool) -> FloatArray:
    """Standard deviations of a shared vector; NaN if it was not estimated."""
    if key not in covariance.shared or held:
        return np.full(3 if key == ANTENNA else 1, np.nan)
    return np.asarray(np.sqrt(np.diagonal(covariance.shared[key])))

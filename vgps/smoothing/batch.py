"""Stage D, Kume 2010: everything at once, reliabilities included, by batch Levenberg-Marquardt."""

from dataclasses import dataclass, replace

import numpy as np

from factors import stages
from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geometry import triangulate
from vgps.model import BoolArray, FloatArray
from vgps.smoothing.assembly import (
    Scene,
    build_problem,
    gps_and_motion,
    other_pose_factors,
    select_observations,
)
from vgps.smoothing.balance import balanced, variance_factor
from vgps.smoothing.bundle import BundleProblem, cost_terms
from vgps.smoothing.fixes import Fixes, antenna_at, gps_graph, place, taking_part
from vgps.smoothing.judging import Judgement, judges, probabilities
from vgps.smoothing.lag import settle_lag
from vgps.smoothing.schur import Covariances, SolverSettings, solve
from vgps.smoothing.sensors import ANTENNA, LAG, Sensors
from vgps.smoothing.uncertainty import ErrorSources, drawn_covariances
from vgps.solution import Observations, SolverReport

_FIRST_TOLERANCE = 5.0


@dataclass(frozen=True)
class Smoothed:
    """What stage D found.

    Attributes:
        poses: (F, 4, 4) and their ``covariance`` (F, 6, 6) in the camera's tangent [rotation; translation],
            NaN if the system does not determine them.
        points: (L, 3) and reliabilities ``sigma_px`` (L,), NaN for features that were left out.
        observations: Those that took part.
        judgement: Of the fixes.
        sensors: Lag and lever arm, estimated or as they were.
        lag_sigma_s: (1,), ``antenna_sigma_m`` (3,): their standard deviations, NaN where not estimated.
        report: Cost per term before and after, iterations, why it stopped.
        warnings: In words.
        problem: What was solved last, at its end.
    """

    poses: FloatArray
    covariance: FloatArray
    points: FloatArray
    sigma_px: FloatArray
    observations: Observations
    judgement: Judgement
    sensors: Sensors
    lag_sigma_s: FloatArray
    antenna_sigma_m: FloatArray
    report: SolverReport
    warnings: tuple[str, ...]
    problem: BundleProblem


def optimise_batch(
    scene: Scene,
    K: FloatArray,
    fixes: Fixes,
    sensors: Sensors,
    config: Config,
    fixed: BoolArray | None = None,
    judgement: Judgement | None = None,
) -> Smoothed:
    """Minimise the energy (11) over all poses and features, in a few rounds.

    Between rounds sightings and fixes are judged anew, features that lost their place are triangulated again
    (19), and reliabilities (13) recomputed. The first round raises the exponent of the GPS walls in stages.

    Args:
        scene: All frames, posed, and all features with their sightings.
        K: (3, 3).
        fixes: All fixes, by their own clock.
        sensors: Lag and lever arm to begin with, and whether they are estimated with the poses.
        config: Weights, rounds and GPS model.
        fixed: (F,) frames to hold, where no fix ties the scene.
        judgement: Of the fixes, to begin with.

    Raises:
        GeometryError: No step lowers the cost of a start that is no minimum.
    """
    current, iterations = scene, 0
    remark: tuple[str, ...] = ()
    judgement = judgement or Judgement.none(len(fixes))
    weighted = config
    for round_ in range(config.batch.rounds):
        # maps that were only just joined show lags that are none
        if round_ == 1:
            believed = judgement.applied(fixes)
            sensors, remark = settle_lag(sensors, current.poses, scene.t_s, believed, config.sensors)
        for n in stages(config.gps.n) if round_ == 0 else [config.gps.n]:
            tolerance = _FIRST_TOLERANCE if round_ == 0 else 1.0
            kept, sigma = select_observations(current, K, config, tolerance)
            in_time = judgement.applied(fixes).earlier(sensors.lag_s)
            began = sensors
            graph = gps_and_motion(kept, K, in_time, began, config, n)
            reliability = np.nan_to_num(sigma, nan=1.0)
            problem = build_problem(kept, K, reliability, graph, weighted, fixed, sensors.shared())
            last = round_ == config.batch.rounds - 1
            result = solve(problem, _settings(config, last), config.batch.solver)
            if result.stuck and round_ == 0:
                raise GeometryError(
                    f"the optimiser made no step: {result.report.stop_reason}",
                    remedy="check the camera's calibration, the GPS log and their clocks",
                )
            iterations += result.report.iterations
            current = replace(
                current, poses=result.problem.world_T_camera, points=result.problem.world_p_landmark
            )
            sensors = sensors.moved(result.problem.shared)
        if round_ < config.batch.rounds - 1:
            current = _retriangulated(current, K, sigma, config)
            in_time = fixes.earlier(sensors.lag_s)
            judgement = judgement.updated(_judged(current, in_time, sensors, config))
            weighted = _rebalanced(config, weighted, current, judgement.applied(in_time), sensors)
    after = result.problem
    report, warnings = _report(scene, after, iterations, result.report.stop_reason)
    if not result.converged:
        warnings = (*warnings, f"stage D did not reach a minimum: {result.report.stop_reason}")
    covariance, doubts = _covariance(after, kept, K, in_time, began, config)
    # what all tracks have in common shows in no track, but in fixes that fit worse than their regions say
    in_time = judgement.applied(fixes).earlier(sensors.lag_s)
    antenna = sensors.camera_p_antenna
    covariance = covariance.scaled(variance_factor(config, after.world_T_camera, scene.t_s, in_time, antenna))
    return Smoothed(
        after.world_T_camera,
        covariance.poses,
        after.world_p_landmark,
        sigma,
        kept.observations,
        judgement,
        sensors,
        _sigma(covariance, LAG, sensors.prior_lag.sigma_s == 0.0),
        _sigma(covariance, ANTENNA, sensors.antenna_sigma_m == 0.0),
        report,
        (*remark, *warnings, *doubts),
        after,
    )


def _rebalanced(config: Config, weighted: Config, scene: Scene, fixes: Fixes, sensors: Sensors) -> Config:
    """The configuration with the video's scale as the fixes' misfit asks for it."""
    scale = weighted.batch.video_sigma_scale
    scale = balanced(config, scale, scene.poses, scene.t_s, fixes, sensors.camera_p_antenna)
    return config.model_copy(update={"batch": config.batch.model_copy(update={"video_sigma_scale": scale})})


def _judged(scene: Scene, fixes: Fixes, sensors: Sensors, config: Config) -> Judgement:
    placement = place(scene.t_s, fixes.t_s)
    judged = fixes.used & placement.inside
    if not judges(config) or not judged.any():
        return Judgement.none(len(fixes))
    offset = antenna_at(scene.poses, placement, sensors.camera_p_antenna) - fixes.world_p_fix
    offset[~judged] = np.nan
    return probabilities(offset, fixes, config)


def _settings(config: Config, last: bool) -> SolverSettings:
    if last:
        tolerance, iterations = config.batch.relative_tolerance, 2 * config.batch.iterations
    else:
        tolerance, iterations = config.batch.early_tolerance, config.batch.iterations
    return SolverSettings(max_iterations=iterations, relative_tolerance=tolerance)


def _retriangulated(scene: Scene, K: FloatArray, sigma_px: FloatArray, config: Config) -> Scene:
    """Features that were left out get a new chance from the improved poses."""
    out = np.isnan(sigma_px)
    rows = np.flatnonzero(out[scene.observations.landmark])
    rows = rows[np.argsort(scene.observations.landmark[rows], kind="stable")]
    landmark, start, count = np.unique(
        scene.observations.landmark[rows], return_index=True, return_counts=True
    )
    if len(landmark) == 0:
        return scene
    enough = np.repeat(count, count) >= config.mapping.min_views
    rows, landmark = rows[enough], landmark[count >= config.mapping.min_views]
    start = np.searchsorted(scene.observations.landmark[rows], landmark)
    if len(landmark) == 0:
        return scene
    found, _ = triangulate(
        K, scene.poses[scene.observations.frame[rows]], scene.observations.uv_px[rows], start
    )
    points = scene.points.copy()
    points[landmark] = found
    return replace(scene, points=points)


def _report(
    start: Scene, after: BundleProblem, iterations: int, reason: str
) -> tuple[SolverReport, tuple[str, ...]]:
    """Costs of the final problem at the start of D and at its end."""
    before = cost_terms(replace(after, world_T_camera=start.poses, world_p_landmark=start.points))
    cost_after = cost_terms(after)
    warnings: tuple[str, ...] = ()
    if sum(cost_after.values()) > sum(before.values()):
        warnings = ("stage D ended at a higher cost than it began with, after outliers had been dropped",)
    return SolverReport(before, cost_after, iterations, reason), warnings


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

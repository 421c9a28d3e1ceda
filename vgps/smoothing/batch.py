"""Stage D, Kume 2010: everything at once, reliabilities included, by batch Levenberg-Marquardt."""

from dataclasses import dataclass, replace

import numpy as np

from factors import stages
from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geometry import triangulate
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.gps.outlier_detection import FixAssessment, detects_outliers, probabilities
from vgps.gps.sensors import Sensors
from vgps.gps.time_offset import update_time_offset
from vgps.model import BoolArray, FloatArray
from vgps.smoothing.batch_result import BatchResult, SolvedBatch, report_of, smoothed
from vgps.smoothing.factor_graph import (
    Scene,
    build_problem,
    gps_and_motion,
    select_observations,
)
from vgps.smoothing.variance_components import balanced
from vgps.solver.bundle_adjustment import BundleResult, SolverSettings, solve

_FIRST_TOLERANCE = 5.0


def optimise_batch(
    scene: Scene,
    K: FloatArray,
    fixes: Fixes,
    sensors: Sensors,
    config: Config,
    fixed: BoolArray | None = None,
    assessment: FixAssessment | None = None,
) -> BatchResult:
    """Minimise the energy (11) over all poses and features, in a few rounds.

    Between rounds observations and fixes are judged anew, features that lost their place are triangulated
    again (19), and reliabilities (13) recomputed. The first round raises the exponent of the GPS walls in
    stages.

    Args:
        scene: All frames, posed, and all features with their observations.
        K: (3, 3).
        fixes: All fixes, by their own clock.
        sensors: TimeOffset and lever arm to begin with, and whether they are estimated with the poses.
        config: Weights, rounds and GPS model.
        fixed: (F,) frames to hold, where no fix ties the scene.
        assessment: Of the fixes, to begin with.

    Raises:
        GeometryError: No step lowers the cost of a start that is no minimum.
    """
    estimate = _Estimate(scene, sensors, assessment or FixAssessment.none(len(fixes)), config)
    last = config.batch.rounds - 1
    remark: tuple[str, ...] = ()
    iterations = 0
    for round_ in range(config.batch.rounds):
        if round_ == 1:  # maps that were only just joined show lags that are none
            estimate, remark = _with_lag(estimate, fixes, config)
        for n in stages(config.gps.n) if round_ == 0 else [config.gps.n]:
            solved = _solved(estimate, K, fixes, config, n, fixed, (round_ == 0, round_ == last))
            estimate = estimate.after(solved.result)
            iterations += solved.result.report.iterations
        if round_ < last:
            estimate = _judged_anew(estimate, K, fixes, solved, config)
    report, warnings = report_of(scene, solved.result, iterations)
    said = *remark, *warnings
    return smoothed(solved, K, fixes, estimate.assessment, estimate.sensors, config, report, said)


@dataclass(frozen=True)
class _Estimate:
    """What the rounds have found so far; ``weighted`` is the configuration with the video's weight."""

    scene: Scene
    sensors: Sensors
    assessment: FixAssessment
    weighted: Config

    def after(self, result: BundleResult) -> "_Estimate":
        """With what a solver found."""
        problem = result.problem
        scene = replace(self.scene, poses=problem.world_T_camera, points=problem.world_p_landmark)
        return replace(self, scene=scene, sensors=self.sensors.moved(problem.shared))

    def believed(self, fixes: Fixes) -> Fixes:
        """The fixes as they are judged, at the times at which they were true."""
        return self.assessment.applied(fixes).earlier(self.sensors.time_offset_s)


def _with_lag(estimate: _Estimate, fixes: Fixes, config: Config) -> tuple[_Estimate, tuple[str, ...]]:
    """With the lag that the fixes show, and what is to be said of it."""
    scene, believed = estimate.scene, estimate.assessment.applied(fixes)
    sensors, remark = update_time_offset(estimate.sensors, scene.poses, scene.t_s, believed, config.sensors)
    return replace(estimate, sensors=sensors), remark


def _solved(
    estimate: _Estimate,
    K: FloatArray,
    fixes: Fixes,
    config: Config,
    n: int,
    fixed: BoolArray | None,
    first_last: tuple[bool, bool],
) -> SolvedBatch:
    """The problem of a round with the walls' exponent ``n``, solved."""
    first, last = first_last
    kept, sigma = select_observations(estimate.scene, K, config, _FIRST_TOLERANCE if first else 1.0)
    in_time, sensors = estimate.believed(fixes), estimate.sensors
    graph = gps_and_motion(kept, K, in_time, sensors, config, n)
    reliability = np.nan_to_num(sigma, nan=1.0)
    problem = build_problem(kept, K, reliability, graph, estimate.weighted, fixed, sensors.shared())
    result = solve(problem, _settings(config, last), config.batch.solver)
    if result.stuck and first:
        raise GeometryError(
            f"the optimiser made no step: {result.report.stop_reason}",
            remedy="check the camera's calibration, the GPS log and their clocks",
        )
    return SolvedBatch(result, kept, sigma, in_time, sensors)


def _judged_anew(
    estimate: _Estimate, K: FloatArray, fixes: Fixes, solved: SolvedBatch, config: Config
) -> _Estimate:
    """With features that were left out, verdicts and weights as the improved poses have them."""
    scene = _retriangulated(estimate.scene, K, solved.sigma, config)
    in_time = fixes.earlier(estimate.sensors.time_offset_s)
    assessment = estimate.assessment.updated(_judged(scene, in_time, estimate.sensors, config))
    weighted = _rebalanced(config, estimate.weighted, scene, assessment.applied(in_time), estimate.sensors)
    return _Estimate(scene, estimate.sensors, assessment, weighted)


def _rebalanced(config: Config, weighted: Config, scene: Scene, fixes: Fixes, sensors: Sensors) -> Config:
    """The configuration with the video's scale as the fixes' misfit asks for it."""
    scale = weighted.batch.video_sigma_scale
    scale = balanced(config, scale, scene.poses, scene.t_s, fixes, sensors.camera_p_antenna)
    return config.model_copy(update={"batch": config.batch.model_copy(update={"video_sigma_scale": scale})})


def _judged(scene: Scene, fixes: Fixes, sensors: Sensors, config: Config) -> FixAssessment:
    placement = place(scene.t_s, fixes.t_s)
    judged = fixes.used & placement.inside
    if not detects_outliers(config) or not judged.any():
        return FixAssessment.none(len(fixes))
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

"""Result of stage D: the last problem's solution, with standard deviations and a report."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.errors import GeometryError
from vgps.gps.antenna_path import antenna_offsets
from vgps.gps.fix_conflict import FixConflict
from vgps.gps.learned_errors import LearnedErrors
from vgps.gps.offsets import offset_key
from vgps.gps.outlier_detection import FixAssessment
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors
from vgps.model import FixClass, FloatArray, IntArray
from vgps.smoothing.context import RigMount, SmoothingContext
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.sigmas.covariance import ErrorSources, drawn_covariances
from vgps.smoothing.stage_d.batch_problem import BatchInput, BatchProblem
from vgps.smoothing.stage_d.graph_arrays import graph_arrays
from vgps.smoothing.stage_d.imu_states import ImuBias, imu_links, middle_bias
from vgps.smoothing.stage_d.lever_arm_check import lever_arm_warnings
from vgps.smoothing.stage_d.long_steps import covariances_once
from vgps.smoothing.stage_d.variance_components import variance_factor
from vgps.solution import Observations, SolverReport, Trajectory
from vgps.solver.bundle_adjustment import BundleResult
from vgps.solver.cost import cost_terms
from vgps.solver.marginals import Covariances
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True, kw_only=True)
class BatchResult:
    """Result of stage D.

    Attributes:
        trajectory: Poses of all frames.
        covariance: (F, 6, 6) of the poses in the camera's tangent [rotation; translation]; NaN if the system
            does not determine them.
        points: (L, 3) positions of the features.
        sigma_px: (L,) their reliabilities; NaN for deselected features.
        observations: Observations used.
        loop: (N,) number of the loop that each of them belongs to, -1 for those of tracks.
        assessment: Assessment of the fixes.
        sensors: Time offset and lever arm, estimated or as given.
        time_offset_sigma_s: (1,) its standard deviation, NaN if it was not estimated.
        antenna_sigma_m: (3,) standard deviations of the lever arm, NaN if it was not estimated.
        report: Cost per term before and after, iterations, reason for stopping.
        warnings: Warnings for the user.
        problem: The last problem at its optimum.
        errors: Noise and walk of the fix classes that were learned from the recording.
        imu_bias: The IMU's bias in the middle of the recording; None without an IMU.
        graph: Its input as arrays, for the run's factor graph (:mod:`vgps.smoothing.stage_d.graph_arrays`).
        cameras: The other cameras of a rig with their poses on it, refined.
        conflicts: Fixes that contradict each other.
    """

    trajectory: Trajectory
    covariance: FloatArray
    points: FloatArray
    sigma_px: FloatArray
    observations: Observations
    loop: IntArray
    assessment: FixAssessment
    sensors: Sensors
    time_offset_sigma_s: FloatArray
    antenna_sigma_m: FloatArray
    report: SolverReport
    warnings: tuple[str, ...]
    problem: BundleProblem
    errors: Mapping[FixClass, LearnedErrors]
    imu_bias: ImuBias | None
    graph: Mapping[str, npt.NDArray[Any]]
    cameras: tuple[RigMount, ...] = ()
    conflicts: tuple[FixConflict, ...] = ()

    @property
    def readout_s(self) -> float | None:
        """The readout of a rolling shutter, as given or estimated."""
        return None if self.problem.row_times is None else self.problem.row_times.readout_s


@dataclass(frozen=True)
class BatchSolution:
    """One round of stage D: its input, its problem, and the solution."""

    given: BatchInput
    built: BatchProblem
    result: BundleResult


def batch_result(
    solved: BatchSolution,
    assessment: FixAssessment,
    sensors: Sensors,
    report: SolverReport,
    context: SmoothingContext,
) -> BatchResult:
    """Return the solution of the last round with its standard deviations.

    Args:
        solved: The last round.
        assessment: Assessment of all fixes.
        sensors: Time offset and lever arm after the last round.
        report: Report of the optimiser.
        context: Calibration, weights and GPS model.
    """
    after = solved.result.problem
    scene = solved.given.scene
    path = Trajectory(scene.t_s, after.world_T_camera)
    covariance, warnings = _covariance(solved, sensors, context)
    if not context.rough:
        warnings += lever_arm_warnings(solved.given, after)
    # an error common to all tracks leaves no residuals, but fixes then fit worse than their regions predict
    covariance = covariance.scaled(_variance_factor(solved, path, sensors, context))
    return BatchResult(
        trajectory=path,
        covariance=covariance.poses,
        points=after.world_p_landmark,
        sigma_px=solved.given.sigma_px,
        observations=scene.observations,
        loop=np.broadcast_to(-1, len(scene.observations.frame)) if scene.loop is None else scene.loop,
        assessment=assessment,
        sensors=sensors,
        time_offset_sigma_s=_time_offset_sigma(covariance, solved.given.sensors, sensors),
        antenna_sigma_m=_sigma(covariance, ANTENNA, sensors.antenna_sigma_m == 0.0),
        report=report,
        warnings=warnings,
        problem=after,
        errors=solved.given.errors,
        imu_bias=None if solved.given.imu is None else middle_bias(solved.given.imu, after, covariance),
        graph=graph_arrays(solved.given, after),
        cameras=context.cameras,
    )


def report_with_warnings(
    start: Scene, result: BundleResult, iterations: int
) -> tuple[SolverReport, tuple[str, ...]]:
    """Return the costs of the last problem at the start and the end of stage D, and warnings."""
    after, reason = result.problem, result.report.stop_reason
    before = cost_terms(replace(after, world_T_camera=start.poses, world_p_landmark=start.points))
    warnings: list[str] = []
    total_before, total_after = sum(before.values()), sum(result.report.cost_after.values())
    if total_after > total_before:
        warnings += [
            f"stage D raised the cost from {total_before:.6g} to {total_after:.6g} when it removed outliers: "
            "check the poses and the verdicts on the fixes"
        ]
    frames = after.submap_frames
    if frames is not None and len(start.t_s) > 2 * frames and result.report.submaps is None:
        warnings += [
            f"stage D was solved whole, not in submaps of {frames} frames: tracks or loops span too much "
            "of one; give submaps.frames a larger number"
        ]
    if not result.converged:
        warnings += [f"stage D did not converge ({reason}): the poses may improve with more batch.iterations"]
    report = replace(result.report, cost_before=before, iterations=iterations)
    return report, tuple(warnings)


def _covariance(
    solved: BatchSolution, sensors: Sensors, context: SmoothingContext
) -> tuple[Covariances, tuple[str, ...]]:
    """Return the covariances at the optimum; NaN for a rough solution, or with a warning if undetermined."""
    config, gps = context.config, solved.built.gps
    unknown = Covariances(np.full((len(solved.given.scene.t_s), 6, 6), np.nan), {})
    if context.rough:
        return unknown, ()
    sources = ErrorSources(
        gps=gps.bounds,
        others=solved.built.other_factors,
        fixes=gps.bounded,
        camera_sigma=context.held_sigmas,
        noise=gps.noise,
        noise_ratio=gps.noise_ratio,
        drift=config.drift,
        inertial=imu_links(solved.built.other_factors),
        loop=solved.given.scene.loop,
        clock_m=_clock_errors(solved, sensors),
    )
    problem, batch = solved.result.problem, config.batch

    def draw() -> Covariances:
        return drawn_covariances(problem, sources, batch.draws, config.seed)

    try:
        return covariances_once(problem, draw, context.journal), ()
    except GeometryError as error:
        return unknown, (f"the standard deviations of the poses are unknown: {error}",)


def _variance_factor(
    solved: BatchSolution, path: Trajectory, sensors: Sensors, context: SmoothingContext
) -> float:
    """Return the variance factor from what the last round left between antennas and fixes."""
    gps, batch = solved.built.gps, context.config.batch
    if len(gps.offsets):
        states = solved.result.problem.states
        offset = np.stack([states[offset_key(k)].vector for k in range(len(gps.offsets))])
        return max(variance_factor(batch, offset, gps.bounded, gps.weight), 1.0)
    fixes = gps.bounded.without_time_offset(sensors.time_offset_s - solved.given.sensors.time_offset_s)
    offset = antenna_offsets(fixes, path, sensors.camera_p_antenna)
    return variance_factor(batch, offset, fixes, gps.weight)


def _clock_errors(solved: BatchSolution, sensors: Sensors) -> FloatArray:
    """Return how far (C, F, 3) the camera moves within a standard deviation of what was held of a clock."""
    estimated = solved.given.sensors.prior_time_offset.sigma_s > 0.0
    prior_s = 0.0 if estimated else sensors.prior_time_offset.sigma_s
    offset_s = prior_s or sensors.held_sigma_s
    position, t_s = solved.result.problem.world_T_camera[:, :3, 3], solved.given.scene.t_s
    if len(t_s) < 2:
        return np.zeros((0, *position.shape))
    from_middle_s = t_s - 0.5 * (t_s[0] + t_s[-1])  # where a rate does not change the time offset
    late_s = np.stack([np.full(len(t_s), offset_s), sensors.clock_rate_sigma * from_middle_s])
    late_s = late_s[late_s.any(axis=1)]
    return np.asarray(late_s[:, :, None] * np.gradient(position, t_s, axis=0), np.float64)


def _time_offset_sigma(covariance: Covariances, solved: Sensors, sensors: Sensors) -> FloatArray:
    """Return the standard deviation (1,) of the time offset, as the poses or the displacements give it."""
    prior_s = sensors.prior_time_offset.sigma_s
    if prior_s and not solved.prior_time_offset.sigma_s:
        return np.array([prior_s])
    return _sigma(covariance, TIME_OFFSET, prior_s == 0.0)


def _sigma(covariance: Covariances, key: int, held: bool) -> FloatArray:
    """Return the standard deviations of a shared vector; NaN if it was not estimated."""
    if key not in covariance.shared or held:
        return np.full(3 if key == ANTENNA else 1, np.nan)
    return np.asarray(np.sqrt(np.diagonal(covariance.shared[key])))

"""Covariance of the poses by Monte Carlo: errors drawn per track and per fix move the linearised optimum.

The inverse Hessian of the energy is not the covariance. A drifting feature does so over many frames, so that
its observations are far from independent; and a cylinder has no curvature near its axis, where the receiver
errs all the same. So the covariance is that of ``x = H^-1 J^T W e`` over draws of the errors e:

- a **track** has one error: its residuals, all of them, with a random sign (the wild bootstrap with a
  cluster per track; Cameron, Gelbach & Miller, Bootstrap-Based Improvements for Inference with Clustered
  Errors, 2008). The residuals give its size; pixel sigmas only weigh it, as in the estimate;
- a **fix** has an error of the size of its class's region, which holds 95 %, and keeps it for the class's
  correlation time: a Gauss-Markov process;
- the **noise** of a fix about its offset, and the walk of the offset, have errors larger than the sigmas that
  weigh them, since the receiver may be worse than others;
- the **video** drifts in scale and rotation, all tracks together, by a share of the random walk of the
  settings ``drift``: a deformation d of the path that leaves no residuals. Of it remains what the other
  factors, with the matrix G, do not take back: ``x = d - H^-1 G d``; loops are among the other factors;
- the **GPS clock**, if its time offset is held at an estimate, has that estimate's error: all fixes are where
  the camera was a little earlier or later;
- the **calibration**, which all tracks share, has an error in focal length, principal point and radial
  distortion;
- every other factor has an error of its sigma.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import gtsam
import numpy as np

from vgps.config import DriftConfig
from vgps.gps.fix_errors import fix_errors
from vgps.gps.fixes import Fixes
from vgps.model import FloatArray, IntArray
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.calibration.camera_equations import held_coupling
from vgps.smoothing.scene.loop_ties import loop_gradient
from vgps.smoothing.sigmas.factor_jacobians import FactorJacobians
from vgps.smoothing.sigmas.track_scores import TrackScores, track_scores
from vgps.smoothing.sigmas.video_drift import drift_by_imu, drift_draws, moved_poses
from vgps.solver.equations.elimination import PoseFactor, SparsityStructure, analyse_sparsity
from vgps.solver.equations.normal_equations import Linearisation, linearise
from vgps.solver.equations.pose_equations import whitened_jacobian
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.marginals import Covariances, factorise_pose_system, split_covariances
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem

_STEPS_AT_ONCE = 2**23  # numbers of the draws' steps, in submaps
_SIGNS_AT_ONCE = 2**22


@dataclass(frozen=True, kw_only=True)
class ErrorSources:
    """The factors on poses and vectors by the source of their errors.

    Attributes:
        gps: A factor for each fix that takes part, or for each offset; in order of time, residuals (3,).
        others: All other factors.
        fixes: The fixes of the factors in ``gps`` with their regions, the time offset removed.
        camera_sigma: (p,) standard deviations of the calibration, see
            :func:`vgps.smoothing.calibration.camera_equations.held_coupling`.
        noise: Factors of the noise about offsets and of their walk, residuals (3,).
        noise_ratio: (N,) their errors over their sigmas.
        drift: Drift of the video.
        inertial: Preintegrated rates and forces, which are among the others; they show a drift.
        loop: (N,) number of the loop of each observation, -1 for those of tracks; None without loops.
        clock_m: (C, F, 3) how far the camera moves within a standard deviation of each error of a clock that
            is not among the shared vectors.
    """

    gps: gtsam.NonlinearFactorGraph
    others: gtsam.NonlinearFactorGraph
    fixes: Fixes
    camera_sigma: FloatArray
    noise: gtsam.NonlinearFactorGraph = field(default_factory=gtsam.NonlinearFactorGraph)
    noise_ratio: FloatArray = field(default_factory=lambda: np.zeros(0))
    drift: DriftConfig | None = None
    inertial: gtsam.NonlinearFactorGraph = field(default_factory=gtsam.NonlinearFactorGraph)
    loop: IntArray | None = None
    clock_m: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 3)))


def drawn_covariances(problem: BundleProblem, sources: ErrorSources, draws: int, seed: int) -> Covariances:
    """Return the covariances of poses, states and shared vectors at an optimum.

    Args:
        problem: At its optimum; its pose graph is all factors of ``sources``.
        sources: Sources of the errors.
        draws: Number of draws K; the relative error of the standard deviations is 1 / sqrt(2 K).
        seed: Seed of the random generator.

    Raises:
        GeometryError: Observations and factors do not determine the poses.
    """
    rng = np.random.default_rng(seed)
    structure = analyse_sparsity(problem)
    with one_blas_thread():
        values = all_pose_values(problem)
        linear = linearise(problem, values, structure)
        factor, gradient = factorise_pose_system(linear, structure)
        at_once = draws if structure.submaps is None else _drawn_at_once(structure.n_free)
        camera = held_coupling(problem, linear, structure)
        tracks = track_scores(linear, structure, on_disk=at_once < draws)
        graphs = (sources.others, sources.noise, sources.gps)
        jacobians = FactorJacobians.of(problem, values, graphs, structure)
        system = _System(problem, values, structure, linear, factor, gradient, camera, tracks, jacobians)
        sources = replace(sources, drift=_shown_drift(system, sources))
        blocks: FloatArray = np.zeros((structure.n_free, POSE_DIM, POSE_DIM))
        shared = np.zeros_like(linear.border.hessian)
        for begin in range(0, draws, at_once):
            moved, change = _moved_by_errors(system, sources, min(at_once, draws - begin), rng)
            blocks += moved @ moved.transpose(0, 2, 1)
            shared += change @ change.T
    return split_covariances(problem, structure, blocks / draws, shared / draws)


class _System(NamedTuple):
    """The linearised problem, its factor, its reduced gradient, and what draws of errors are multiplied by.

    That is the coupling (6 n_free, p) with the camera, the scores of the tracks, and the factors' Jacobians.
    """

    problem: BundleProblem
    values: gtsam.Values
    structure: SparsityStructure
    linear: Linearisation
    factor: PoseFactor
    gradient: FloatArray
    camera: FloatArray
    tracks: Iterable[TrackScores]
    factors: FactorJacobians


def _shown_drift(system: _System, sources: ErrorSources) -> DriftConfig | None:
    """Return the drift of the video that the settings expect, or the smaller one that an IMU shows."""
    problem, structure = system.problem, system.structure
    if sources.drift is None or not sources.inertial.size():
        return sources.drift
    imu, residual = whitened_jacobian(problem, sources.inertial, system.values, structure)
    size = POSE_DIM * structure.n_free
    by_place = system.factors.stacked[:, :size]

    def disagreement(drift: FloatArray) -> FloatArray:
        remaining = drift - system.factor.solve(by_place.T @ (by_place @ drift))
        return np.asarray(imu[:, :size] @ remaining)

    return drift_by_imu(problem, structure, sources.drift, residual, disagreement)


def _drawn_at_once(places: int) -> int:
    """Return a number of draws whose steps take little memory beside a submap."""
    return max(1, _STEPS_AT_ONCE // (POSE_DIM * places))


def _moved_by_errors(
    system: _System, sources: ErrorSources, draws: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return movements of poses and states (n_free, 6, K) and of shared vectors (s, K) by drawn errors."""
    problem, structure, camera, J = system.problem, system.structure, system.camera, system.factors.stacked
    size = POSE_DIM * structure.n_free
    right = _pose_factor_draws(system.factors, sources, draws, rng)
    right[:size] += _track_draws(system, draws, rng)
    right[:size] += camera @ (sources.camera_sigma[:, None] * rng.standard_normal((camera.shape[1], draws)))
    drift = drift_draws(problem, structure, sources.drift, draws, rng)
    right -= J.T @ (J[:, :size] @ drift)
    for moved in sources.clock_m:
        late = system.factors.moved_with_fixes(moved_poses(problem, structure, moved))
        right += np.outer(late, rng.standard_normal(draws))
    if sources.loop is not None:
        right[:size] -= loop_gradient(problem, sources.loop, structure, drift)
    shared: FloatArray = np.zeros((0, draws))
    steps = system.factor.solve(right[:size])
    if problem.shared:
        border = system.linear.border
        _, _, by_shared, complement = border.eliminate(system.factor, system.gradient, 0.0)
        rest = right[size:] - border.coupling.T @ steps
        shared = np.linalg.solve(complement, rest).astype(np.float64)
        steps = steps - by_shared @ shared
    return (steps + drift).reshape(structure.n_free, POSE_DIM, draws), shared


def _track_draws(system: _System, draws: int, rng: np.random.Generator) -> FloatArray:
    """Return gradients (6 n_free, K) with the residuals of every track multiplied by a random sign."""
    signs = np.empty((system.linear.landmarks, draws), dtype=np.int8)
    for rows in np.array_split(signs, 1 + signs.size // _SIGNS_AT_ONCE):
        rows[:] = rng.choice([-1, 1], rows.shape)
    total = np.zeros((POSE_DIM * system.structure.n_free, draws))
    for scores in system.tracks:
        scores.add_to(total, signs)
    return total


def _pose_factor_draws(
    factors: FactorJacobians, sources: ErrorSources, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Return gradients (6 n_free + shared, K) of drawn errors of all factors."""
    others, noise = factors.others, factors.noise
    total: FloatArray = others.T @ rng.standard_normal((others.shape[0], draws))
    ratio = np.repeat(sources.noise_ratio, 3)[:, None]
    total += noise.T @ (ratio * rng.standard_normal((noise.shape[0], draws)))
    if sources.gps.size():
        whitened = factors.by_position @ fix_errors(sources.fixes, draws, rng)
        total += factors.gps.T @ whitened.reshape(-1, draws)
    return total

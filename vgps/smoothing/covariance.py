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
- the **calibration**, which all tracks share, has an error in focal length, principal point and radial
  distortion;
- every other factor has an error of its sigma.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import gtsam
import numpy as np
from scipy import sparse

from vgps.config import DriftConfig
from vgps.gps.fix_errors import fix_errors
from vgps.gps.fixes import Fixes
from vgps.model import FloatArray, IntArray
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.camera_equations import linearise_held
from vgps.smoothing.factor_graph import joined
from vgps.smoothing.loop_ties import loop_gradient
from vgps.smoothing.video_drift import drift_by_imu, drift_draws
from vgps.solver.band_matrix import POSE_DIM
from vgps.solver.elimination import PoseFactor, SparsityStructure, analyse_sparsity
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.marginals import Covariances, factorise_pose_system, split_covariances
from vgps.solver.normal_equations import Linearisation, linearise
from vgps.solver.pose_equations import whitened_jacobian
from vgps.solver.problem import BundleProblem
from vgps.solver.schur_complement import pose_scores

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
            :func:`vgps.smoothing.camera_equations.linearise_held`.
        noise: Factors of the noise about offsets and of their walk, residuals (3,).
        noise_ratio: (N,) their errors over their sigmas.
        drift: Drift of the video.
        inertial: Preintegrated rates and forces, which are among the others; they show a drift.
        loop: (N,) number of the loop of each observation, -1 for those of tracks; None without loops.
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
        camera = linearise_held(problem, linear, structure).coupling
        system = _System(problem, values, structure, linear, factor, gradient, camera)
        sources = replace(sources, drift=_shown_drift(system, sources))
        at_once = draws if structure.submaps is None else _drawn_at_once(structure.n_free)
        blocks: FloatArray = np.zeros((structure.n_free, POSE_DIM, POSE_DIM))
        shared = np.zeros_like(linear.border.hessian)
        for begin in range(0, draws, at_once):
            moved, change = _moved_by_errors(system, sources, min(at_once, draws - begin), rng)
            blocks += moved @ moved.transpose(0, 2, 1)
            shared += change @ change.T
    return split_covariances(problem, structure, blocks / draws, shared / draws)


class _System(NamedTuple):
    """The linearised problem, its factor, reduced gradient, and coupling (6 n_free, p) with the camera."""

    problem: BundleProblem
    values: gtsam.Values
    structure: SparsityStructure
    linear: Linearisation
    factor: PoseFactor
    gradient: FloatArray
    camera: FloatArray


def _shown_drift(system: _System, sources: ErrorSources) -> DriftConfig | None:
    """Return the drift of the video that the settings expect, or the smaller one that an IMU shows."""
    problem, values, structure, _, factor, *_ = system
    if sources.drift is None or not sources.inertial.size():
        return sources.drift
    graph = joined(sources.gps, sources.noise, sources.others)
    J, imu = (whitened_jacobian(problem, one, values, structure) for one in (graph, sources.inertial))
    size = POSE_DIM * structure.n_free
    by_place = J[0][:, :size]

    def disagreement(drift: FloatArray) -> FloatArray:
        remaining = drift - factor.solve(by_place.T @ (by_place @ drift))
        return np.asarray(imu[0][:, :size] @ remaining)

    return drift_by_imu(problem, structure, sources.drift, imu[1], disagreement)


def _drawn_at_once(places: int) -> int:
    """Return a number of draws whose steps take little memory beside a submap."""
    return max(1, _STEPS_AT_ONCE // (POSE_DIM * places))


def _moved_by_errors(
    system: _System, sources: ErrorSources, draws: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return movements of poses and states (n_free, 6, K) and of shared vectors (s, K) by drawn errors."""
    problem, values, structure, linear, factor, gradient, camera = system
    size = POSE_DIM * structure.n_free
    right, J = _pose_factor_draws(problem, values, sources, structure, draws, rng)
    right[:size] += _track_draws(linear, structure, draws, rng)
    right[:size] += camera @ (sources.camera_sigma[:, None] * rng.standard_normal((camera.shape[1], draws)))
    drift = drift_draws(problem, structure, sources.drift, draws, rng)
    right -= J.T @ (J[:, :size] @ drift)
    if sources.loop is not None:
        right[:size] -= loop_gradient(problem, sources.loop, structure, drift)
    shared: FloatArray = np.zeros((0, draws))
    steps = factor.solve(right[:size])
    if problem.shared:
        _, _, by_shared, complement = linear.border.eliminate(factor, gradient, 0.0)
        rest = right[size:] - linear.border.coupling.T @ steps
        shared = np.linalg.solve(complement, rest).astype(np.float64)
        steps = steps - by_shared @ shared
    return (steps + drift).reshape(structure.n_free, POSE_DIM, draws), shared


def _track_draws(
    linear: Linearisation, structure: SparsityStructure, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Return gradients (6 n_free, K) with the residuals of every track multiplied by a random sign."""
    signs = np.empty((linear.landmarks, draws), dtype=np.int8)
    for rows in np.array_split(signs, 1 + signs.size // _SIGNS_AT_ONCE):
        rows[:] = rng.choice([-1, 1], rows.shape)
    total = np.zeros((POSE_DIM * structure.n_free, draws))
    for part in linear.chunks:
        chunk, score = part.chunk, pose_scores(part)
        row = structure.free[chunk.first_frame + chunk.coupled.frame]
        free = row >= 0
        if not free.any():
            continue
        first, last = int(row[free].min()), int(row.max())
        index = (POSE_DIM * (row[free] - first) + np.arange(POSE_DIM)[:, None]).ravel()
        entries = (score[:, free].ravel(), (index, np.tile(chunk.coupled.landmark[free], POSE_DIM)))
        by_track = sparse.csr_array(entries, shape=(POSE_DIM * (last + 1 - first), len(chunk.landmarks)))
        total[POSE_DIM * first : POSE_DIM * (last + 1)] += by_track @ signs[chunk.landmarks]
    return total


def _pose_factor_draws(
    problem: BundleProblem,
    values: gtsam.Values,
    sources: ErrorSources,
    structure: SparsityStructure,
    draws: int,
    rng: np.random.Generator,
) -> tuple[FloatArray, sparse.csr_array]:
    """Return gradients (6 n_free + shared, K) of drawn errors of all factors, and their Jacobian."""
    others, noise, by_fix = (
        whitened_jacobian(problem, graph, values, structure)[0]
        for graph in (sources.others, sources.noise, sources.gps)
    )
    total: FloatArray = others.T @ rng.standard_normal((others.shape[0], draws))
    ratio = np.repeat(sources.noise_ratio, 3)[:, None]
    total += noise.T @ (ratio * rng.standard_normal((noise.shape[0], draws)))
    if sources.gps.size():
        errors = fix_errors(sources.fixes, draws, rng)
        whitened = _residual_by_fix(problem, by_fix, sources, structure) @ errors
        total += by_fix.T @ whitened.reshape(-1, draws)
    return total, sparse.csr_array(sparse.vstack([others, noise, by_fix]))


def _residual_by_fix(
    problem: BundleProblem, by_pose: sparse.csr_array, sources: ErrorSources, structure: SparsityStructure
) -> FloatArray:
    """Return the derivative (M, 3, 3) of the whitened residuals by the fixes' positions, up to the sign.

    A common translation of both frames moves the antenna relative to the fix, so that the derivative is the
    sum of the Jacobians by their translations; or it is the Jacobian by the offset.
    """
    result = np.zeros((sources.gps.size(), 3, 3))
    for row in range(len(result)):
        keys = [key for key in list(sources.gps.at(row).keys()) if key not in problem.shared]
        offsets = [key for key in keys if key in problem.states]
        keys = [key for key in keys if key not in problem.states]
        if not keys:  # a bound of an offset
            start = POSE_DIM * structure.states[offsets[0]]
            result[row] = by_pose[3 * row : 3 * row + 3, start : start + 3].toarray()
        for frame in problem.frames_of(keys).tolist():
            start = POSE_DIM * int(structure.free[frame]) + 3
            if structure.free[frame] >= 0:
                translation = by_pose[3 * row : 3 * row + 3, start : start + 3].toarray()
                result[row] += translation @ problem.world_T_camera[frame, :3, :3].T
    return result

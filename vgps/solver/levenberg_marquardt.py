"""Levenberg-Marquardt over the reduced normal equations."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.equations.normal_equations import Linearisation, linearise
from vgps.solver.equations.schur_complement import landmark_steps, reduce_to_poses
from vgps.solver.iterate import Iterate, Step, retract
from vgps.solver.matrices.band_matrix import NotPositiveDefiniteError

LIGHT_DAMPING = 1e-2
"""Damping up to which a step is nearly Gauss-Newton's, so that no decrease means a minimum."""
_STEP_FRACTIONS = (1.0, 0.5, 0.25)  # tried in turn while the gain is poor
_POOR_GAIN_RATIO = 0.25  # below this ratio of actual to predicted decrease, shorter steps are tried
_STEP_MULTIPLES = (2.0, 4.0, 8.0, 16.0)  # tried in turn after a rich gain, while they lower the cost
_RICH_GAIN_RATIO = 1.75  # above this ratio, longer steps are tried; a cost without curvature has 2
_MAX_SMALL_STEPS = 3  # successive steps below the tolerance that end the search even under heavy damping


@dataclass(frozen=True, kw_only=True)
class SolverSettings:
    """Stopping criteria, damping and limits.

    Attributes:
        max_iterations: Maximum number of linearisations.
        relative_tolerance: Stop once a step lowers the cost by no more than this fraction of it.
        absolute_tolerance: Stop once a step lowers the cost by no more than this.
        lambda_start: Damping of the first step, relative to the Hessian's diagonal.
        lambda_factor: Factor by which the damping falls after a step and rises after a rejected one.
        lambda_min, lambda_max: Bounds of the damping; no step is tried above the upper one.
        min_gain_ratio: A step is accepted if the cost falls by more than this fraction of the prediction.
        max_flops: Operations per iteration, of a submap if there are any, above which GTSAM's optimiser is
            used instead.
        max_bytes: Memory of matrix, factor and buffers, likewise.
    """

    max_iterations: int = 100
    relative_tolerance: float = 1e-6
    absolute_tolerance: float = 1e-9
    lambda_start: float = 1e-5
    lambda_factor: float = 10.0
    lambda_min: float = 1e-12
    lambda_max: float = 1e10
    min_gain_ratio: float = 1e-3
    max_flops: float = 3e11
    max_bytes: float = 2e9

    def tolerance(self, cost: float) -> float:
        """Return the decrease below which this cost counts as unchanged."""
        return max(self.absolute_tolerance, self.relative_tolerance * cost)


@dataclass(frozen=True)
class Termination:
    """How an optimiser ended.

    Attributes:
        iterations: Number of linearisations.
        reason: Why it stopped.
        converged: Whether a tolerance was reached.
        stuck: Whether no step lowered the cost although the start is no minimum.
    """

    iterations: int
    reason: str
    converged: bool = False
    stuck: bool = False


class _SearchResult(NamedTuple):
    """An iterate of lower cost, or the same one if none was found, and the damping that led there.

    ``at_minimum`` says that a lightly damped step predicted a decrease below the tolerance.
    """

    iterate: Iterate
    damping: float
    at_minimum: bool


def minimise(
    start: Iterate, structure: SparsityStructure, settings: SolverSettings
) -> tuple[Iterate, Termination]:
    """Minimise the cost by Levenberg-Marquardt.

    Args:
        start: The start, of finite cost.
        structure: Structure of the problem.
        settings: Stopping criteria and damping.
    """
    iterate, damping, small_steps = start, settings.lambda_start, 0
    for iteration in range(settings.max_iterations):
        better, used, at_minimum = _search(iterate, structure, damping, settings)
        decrease = iterate.cost - better.cost
        if at_minimum:
            return better, _converged(iteration, decrease)
        if better is iterate:
            reason = f"no step lowers the cost, with a damping of up to {used:.0e}"
            return iterate, Termination(iteration, reason, stuck=iteration == 0)
        small_steps = small_steps + 1 if decrease <= settings.tolerance(iterate.cost) else 0
        iterate, damping = better, max(used / settings.lambda_factor, settings.lambda_min)
        if small_steps == _MAX_SMALL_STEPS or (small_steps and used <= LIGHT_DAMPING):
            return iterate, _converged(iteration + 1, decrease)
    reason = f"stopped after {settings.max_iterations} iterations"
    return iterate, Termination(settings.max_iterations, reason)


def _converged(iterations: int, decrease: float) -> Termination:
    reason = f"converged: the last step lowered the cost by {decrease:.3g}"
    return Termination(iterations, reason, converged=True)


def _search(
    iterate: Iterate, structure: SparsityStructure, damping: float, settings: SolverSettings
) -> _SearchResult:
    """Raise the damping until a step lowers the cost."""
    linear = linearise(iterate.problem, iterate.values, structure)
    used = damping
    while damping <= settings.lambda_max:
        used = damping
        step = _solve_step(linear, structure, damping)
        negligible = step is not None and step.predicted <= settings.tolerance(iterate.cost)
        better = None if step is None else _line_search(iterate, structure, step, settings)
        if step is not None and better is not None and damping <= LIGHT_DAMPING:
            better = _further(iterate, better, structure, step)
        if better is not None or negligible:
            return _SearchResult(better or iterate, damping, negligible and damping <= LIGHT_DAMPING)
        damping *= settings.lambda_factor
    return _SearchResult(iterate, used, False)


def _solve_step(linear: Linearisation, structure: SparsityStructure, damping: float) -> Step | None:
    """Return the step of the damped normal equations; None if they are not positive definite."""
    matrix, gradient = reduce_to_poses(linear, structure, damping)
    try:
        factor = structure.cholesky(matrix)
    except NotPositiveDefiniteError:
        return None
    reduced, shared, _, _ = linear.border.eliminate(factor, gradient, damping)
    landmarks = landmark_steps(linear, structure.to_frames(reduced), damping)
    slope = float(linear.gradient @ reduced + linear.border.gradient @ shared)
    damped = float(linear.diagonal @ reduced**2 + linear.border.diagonal @ shared**2)
    for part in linear.chunks:
        step = landmarks[:, part.chunk.landmarks]
        slope += float(np.sum(part.gradient * step))
        damped += float(np.sum(part.diagonal * step**2))
    return Step(reduced, landmarks.T, shared, 0.5 * (damping * damped - slope))


def _line_search(
    iterate: Iterate, structure: SparsityStructure, step: Step, settings: SolverSettings
) -> Iterate | None:
    """Return the best iterate along the step; None if the cost does not fall enough.

    Penalty walls and robust losses are far from quadratic: where the actual decrease is far below the
    prediction, the step went too far.
    """
    if not np.isfinite(step.predicted):
        return None
    best = iterate
    for fraction in _STEP_FRACTIONS:
        trial = retract(iterate, structure, step, fraction)
        if trial.cost < best.cost:  # false of NaN
            best = trial
        if iterate.cost - best.cost >= _POOR_GAIN_RATIO * step.predicted:
            break
    accepted = iterate.cost - best.cost > max(settings.min_gain_ratio * step.predicted, 0.0)
    return best if accepted else None


def _further(iterate: Iterate, better: Iterate, structure: SparsityStructure, step: Step) -> Iterate:
    """Return the better iterate, or a still better one beyond it if the full step falls far short.

    Where a robust loss flattens, the model overestimates the curvature, and up to dozens of short steps, each
    longer than the last, would lead out of it: here the step is doubled instead, while that lowers the cost.
    """
    if iterate.cost - better.cost <= _RICH_GAIN_RATIO * step.predicted:
        return better
    for multiple in _STEP_MULTIPLES:
        trial = retract(iterate, structure, step, multiple)
        if not trial.cost < better.cost:
            break
        better = trial
    return better

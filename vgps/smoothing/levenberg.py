"""Levenberg-Marquardt over the reduced normal equations."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.model import FloatArray
from vgps.smoothing.band import POSE, NotPositiveDefiniteError
from vgps.smoothing.bundle import BundleProblem, cost_terms
from vgps.smoothing.normal import (
    Linearization,
    Structure,
    factor_points,
    linearize,
    point_steps,
    reduce_to_poses,
)

_MINIMUM = "converged: the linear model promises no decrease worth a step"
_LIGHT = 1e-2  # damping that leaves a step nearly a Gauss-Newton step, so that a short one means a minimum
_SMALL_STEPS = 3  # in succession that end the search even under heavy damping


@dataclass(frozen=True)
class SolverSettings:
    """When to stop, and how to damp.

    Attributes:
        max_iterations: Linearisations.
        relative_tolerance: Stop once a step lowers the cost by no more than this part of it.
        absolute_tolerance: Stop once a step lowers the cost by no more than this.
        lambda_start: Damping of the first step, as a part of the Hessian's diagonal.
        lambda_factor: The damping is divided by it after a step, multiplied by it after a refusal.
        lambda_least, lambda_most: Its bounds; beyond the upper one there is no step.
        least_gain: A step must lower the cost by this part of what the linear model promised.
        max_flops: Operations per iteration above which GTSAM's optimiser takes over.
        max_bytes: Memory of band and blocks above which it does.
    """

    max_iterations: int = 100
    relative_tolerance: float = 1e-6
    absolute_tolerance: float = 1e-9
    lambda_start: float = 1e-5
    lambda_factor: float = 10.0
    lambda_least: float = 1e-12
    lambda_most: float = 1e10
    least_gain: float = 1e-3
    max_flops: float = 3e11
    max_bytes: float = 2e9


@dataclass(frozen=True)
class Outcome:
    """Where an optimiser ended: after how many iterations, why, and :class:`BundleResult`'s two flags."""

    problem: BundleProblem
    iterations: int
    reason: str
    converged: bool
    stuck: bool


def levenberg(problem: BundleProblem, structure: Structure, settings: SolverSettings) -> Outcome:
    """Lower the cost until the settings say stop.

    Args:
        problem: The start, of finite cost.
        structure: :func:`structure_of` it.
        settings: When to stop, and how to damp.
    """
    cost, damping, small_steps = sum(cost_terms(problem).values()), settings.lambda_start, 0
    for iteration in range(settings.max_iterations):
        search = _search(problem, structure, cost, damping, settings)
        if isinstance(search, str):
            minimum = search == _MINIMUM
            return Outcome(problem, iteration, search, minimum, iteration == 0 and not minimum)
        problem, new_cost, used = search
        decrease, tolerance, cost = cost - new_cost, _tolerance(cost, settings), new_cost
        damping = max(used / settings.lambda_factor, settings.lambda_least)
        small_steps = small_steps + 1 if decrease <= tolerance else 0
        if small_steps == _SMALL_STEPS or (small_steps and used <= _LIGHT):
            reason = f"converged: the last step lowered the cost by {decrease:.3g}"
            return Outcome(problem, iteration + 1, reason, True, False)
    reason = f"stopped after {settings.max_iterations} iterations"
    return Outcome(problem, settings.max_iterations, reason, False, False)


def _search(
    problem: BundleProblem, structure: Structure, cost: float, damping: float, settings: SolverSettings
) -> tuple[BundleProblem, float, float] | str:
    """Raise the damping until a step lowers the cost: the problem after it, cost and damping; or why not."""
    linear = linearize(problem, structure)
    while damping <= settings.lambda_most:
        step = _step(linear, structure, damping)
        vain = step is not None and step[2] <= _tolerance(cost, settings)
        if vain and damping <= _LIGHT:
            return _MINIMUM
        accepted = None if step is None else _try(problem, cost, step, settings)
        if accepted is not None:
            return *accepted, damping
        if vain:
            break
        damping *= settings.lambda_factor
    return f"no step lowers the cost, with a damping of up to {damping:.0e}"


def _tolerance(cost: float, settings: SolverSettings) -> float:
    return max(settings.absolute_tolerance, settings.relative_tolerance * cost)


def _step(
    linear: Linearization, structure: Structure, damping: float
) -> tuple[FloatArray, FloatArray, float] | None:
    """Steps of all poses (F, 6) and points (L, 3), and the decrease that the linear model promises."""
    points = factor_points(linear, damping)
    band, gradient = reduce_to_poses(linear, structure, points, damping)
    try:
        free_step = -band.cholesky(structure.half_bandwidth).solve(gradient)
    except NotPositiveDefiniteError:
        return None
    pose_step = np.zeros((len(structure.free), POSE))
    pose_step[structure.free >= 0] = free_step.reshape(-1, POSE)
    point_step = point_steps(linear, points, pose_step)
    slope = float(linear.pose_gradient @ free_step + np.sum(linear.point_gradient.T * point_step))
    damped = float(linear.pose_diagonal @ free_step**2 + np.sum(linear.point_diagonal.T * point_step**2))
    return pose_step, point_step, 0.5 * (damping * damped - slope)


def _try(
    problem: BundleProblem, cost: float, step: tuple[FloatArray, FloatArray, float], settings: SolverSettings
) -> tuple[BundleProblem, float] | None:
    """The problem after the step and its cost, or nothing if the step is refused."""
    pose_step, point_step, promised = step
    if not np.isfinite(promised):
        return None
    trial = moved(problem, pose_step, point_step)
    new_cost = sum(cost_terms(trial).values())
    good = np.isfinite(new_cost) and cost - new_cost > settings.least_gain * promised
    return (trial, new_cost) if good else None


def retract(world_T_camera: FloatArray, step: FloatArray) -> FloatArray:
    """(F, 4, 4) poses moved by (F, 6) steps [rotation; translation]: ``T * Pose3.Expmap(step)``."""
    w, v = step[:, :3], step[:, 3:]
    angle2 = np.sum(w * w, axis=1)
    angle = np.sqrt(angle2)
    small = angle2 < 1e-8
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - angle2 / 6.0, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle2 / 24.0, 2.0 * (np.sin(0.5 * safe) / safe) ** 2)
    c = np.where(small, 1.0 / 6.0 - angle2 / 120.0, (1.0 - a) / safe**2)
    W = np.cross(w[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)
    W2 = W @ W
    rotation = np.eye(3) + a[:, None, None] * W + b[:, None, None] * W2
    shift = v + b[:, None] * np.einsum("fij,fj->fi", W, v) + c[:, None] * np.einsum("fij,fj->fi", W2, v)
    moved = world_T_camera.copy()
    R = world_T_camera[:, :3, :3]
    moved[:, :3, :3] = R @ rotation
    moved[:, :3, 3] += np.einsum("fij,fj->fi", R, shift)
    return moved


def moved(problem: BundleProblem, pose_step: FloatArray, point_step: FloatArray) -> BundleProblem:
    """The problem at the place that (F, 6) and (L, 3) steps lead to."""
    return replace(
        problem,
        world_T_camera=retract(problem.world_T_camera, pose_step),
        world_p_landmark=problem.world_p_landmark + point_step,
    )

"""Levenberg-Marquardt over the reduced normal equations."""

from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.band_matrix import POSE, NotPositiveDefiniteError
from vgps.solver.elimination import Structure
from vgps.solver.landmark_refinement import anchors, best_points, landmark_costs
from vgps.solver.normal_equations import Linearization, linearize, point_steps, reduce_to_poses
from vgps.solver.problem import BundleProblem, all_pose_values

LIGHT_DAMPING = 1e-2  # leaves a step nearly a Gauss-Newton step: a short one then means a minimum
_PARTS = (1.0, 0.5, 0.25)
_POOR = 0.25  # of what was promised
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


@dataclass(frozen=True)
class _State:
    """A place: the problem there, its poses as GTSAM wants them, its cost; each point's :func:`anchors`."""

    problem: BundleProblem
    values: gtsam.Values
    cost: float
    anchor: IntArray


@dataclass(frozen=True)
class _Step:
    """Steps of all poses (F, 6), points (L, 3) and what is shared (s,); the decrease that the linear model
    promises."""

    poses: FloatArray
    points: FloatArray
    shared: FloatArray
    promised: float


def levenberg(problem: BundleProblem, structure: Structure, settings: SolverSettings) -> Outcome:
    """Lower the cost until the settings say stop.

    Args:
        problem: The start, of finite cost.
        structure: ``structure_of`` it.
        settings: When to stop, and how to damp.
    """
    values = all_pose_values(problem)
    cost = float(landmark_costs(problem, structure).sum()) + float(problem.pose_graph.error(values))
    state = _State(problem, values, cost, anchors(problem))
    damping, small_steps = settings.lambda_start, 0
    for iteration in range(settings.max_iterations):
        better, used, vain = _search(state, structure, damping, settings)
        decrease = state.cost - better.cost
        if vain or better is state:
            return _ended(better.problem, iteration, decrease, vain, used)
        small_steps = small_steps + 1 if decrease <= _tolerance(state.cost, settings) else 0
        state, damping = better, max(used / settings.lambda_factor, settings.lambda_least)
        if small_steps == _SMALL_STEPS or (small_steps and used <= LIGHT_DAMPING):
            return _ended(state.problem, iteration + 1, decrease, True, used)
    reason = f"stopped after {settings.max_iterations} iterations"
    return Outcome(state.problem, settings.max_iterations, reason, False, False)


def _ended(
    problem: BundleProblem, iterations: int, decrease: float, converged: bool, damping: float
) -> Outcome:
    if converged:
        reason = f"converged: the last step lowered the cost by {decrease:.3g}"
        return Outcome(problem, iterations, reason, True, False)
    reason = f"no step lowers the cost, with a damping of up to {damping:.0e}"
    return Outcome(problem, iterations, reason, False, iterations == 0)


def _search(
    state: _State, structure: Structure, damping: float, settings: SolverSettings
) -> tuple[_State, float, bool]:
    """Raise the damping until a step lowers the cost.

    Returns the place it leads to, or the same place if there is none; the damping; and whether a lightly
    damped step promised no decrease worth having, which is what a minimum looks like.
    """
    linear = linearize(state.problem, state.values, structure)
    used = damping
    while damping <= settings.lambda_most:
        used = damping
        step = _step(linear, structure, damping)
        vain = step is not None and step.promised <= _tolerance(state.cost, settings)
        better = None if step is None else _try(state, structure, step, settings)
        if better is not None or vain:
            return better or state, damping, vain and damping <= LIGHT_DAMPING
        damping *= settings.lambda_factor
    return state, used, False


def _tolerance(cost: float, settings: SolverSettings) -> float:
    return max(settings.absolute_tolerance, settings.relative_tolerance * cost)


def _step(linear: Linearization, structure: Structure, damping: float) -> _Step | None:
    band, gradient = reduce_to_poses(linear, structure, damping)
    try:
        factor = structure.cholesky(band)
    except NotPositiveDefiniteError:
        return None
    free_step, shared, _, _ = linear.border.eliminate(factor, gradient, damping)
    poses = np.zeros((len(structure.free), POSE))
    poses[structure.free >= 0] = free_step.reshape(-1, POSE)
    points = point_steps(linear, poses, damping)
    slope = float(linear.gradient @ free_step + linear.border.gradient @ shared)
    damped = float(linear.diagonal @ free_step**2 + linear.border.diagonal @ shared**2)
    for part in linear.chunks:
        step = points[:, part.chunk.landmarks]
        slope += float(np.sum(part.gradient * step))
        damped += float(np.sum(part.diagonal * step**2))
    return _Step(poses, points.T, shared, 0.5 * (damping * damped - slope))


def _try(state: _State, structure: Structure, step: _Step, settings: SolverSettings) -> _State | None:
    """The place after the step, or after a part of it that leads lower; nothing if none leads low enough.

    Walls and robust losses are no parabolas: where the model promised far too much, the step overshot.
    """
    if not np.isfinite(step.promised):
        return None
    best = state
    for part in _PARTS:
        trial = _moved(state, structure, step, part)
        if trial.cost < best.cost:  # false of NaN
            best = trial
        if state.cost - best.cost >= _POOR * step.promised:
            break
    good = state.cost - best.cost > max(settings.least_gain * step.promised, 0.0)
    return best if good else None


def _moved(state: _State, structure: Structure, step: _Step, part: float) -> _State:
    """The place after ``part`` of a step."""
    delta = gtsam.VectorValues()
    moves = structure.free >= 0
    for key, pose_step in zip(state.problem.keys[moves].tolist(), part * step.poses[moves], strict=True):
        delta.insert(key, pose_step)
    at = 0
    for key in sorted(state.problem.shared):
        size = len(state.problem.shared[key])
        delta.insert(key, part * step.shared[at : at + size])
        at += size
    values = state.values.retract(delta)
    shared = {key: values.atVector(key) for key in state.problem.shared}
    problem = state.problem.moved(_poses(values, state.problem), state.problem.world_p_landmark, shared)
    points, video = best_points(problem, state.problem, state.anchor, part * step.points, structure)
    problem = problem.moved(problem.world_T_camera, points)
    return _State(problem, values, video + float(problem.pose_graph.error(values)), state.anchor)


def _poses(values: gtsam.Values, before: BundleProblem) -> FloatArray:
    """(F, 4, 4) poses of the values; held ones to the last bit as they were."""
    rows = np.empty((len(before.world_T_camera), 12))
    rows[np.argsort(before.keys)] = gtsam.utilities.extractPose3(values)  # in ascending order of keys
    world_T_camera = before.world_T_camera.copy()
    moves = ~before.fixed_frames
    world_T_camera[moves, :3, :3] = rows[moves, :9].reshape(-1, 3, 3)
    world_T_camera[moves, :3, 3] = rows[moves, 9:]
    return world_T_camera

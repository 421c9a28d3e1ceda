"""Landmarks refined one by one with the poses held, so that a few bad ones do not hold back the poses.

A Levenberg-Marquardt step moves poses and landmarks together by a linear model. For a few landmarks, distant
ones or those of small parallax, the model fails even for short steps, and damping the whole system for
their sake would slow every pose. So each landmark takes its part of a step only if its own observations
gain.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.runtime.threads import map_in_order
from vgps.solver.cost import observation_costs, view_poses
from vgps.solver.equations.chunks import CHUNK_OBSERVATIONS, Chunk, couple
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.equations.normal_equations import linearise_chunk
from vgps.solver.equations.schur_complement import factorise_landmarks
from vgps.solver.integer_sets import numbered
from vgps.solver.problem import BundleProblem

_MIN_LOSS = 1e-3  # a landmark is refined by itself if a step raises its cost by more
_START_DAMPING = 1e-3  # relative to the diagonal
_ITERATIONS = 4  # enough for three unknowns; the next common step refines the landmark further
_MOST_FARTHER = 10.0  # times as far after a step, at most: the linear model also leads beyond infinity


def anchor_frames(problem: BundleProblem) -> IntArray:
    """Return the last frame that observes each landmark, (L,); 0 for one without observations."""
    anchor = np.zeros(len(problem.world_p_landmark), dtype=np.int64)
    np.maximum.at(anchor, problem.landmark, problem.frame)
    return anchor


def move_with_frames(
    points: FloatArray,
    before: FloatArray,
    after: FloatArray,
    anchor: IntArray,
    scale: FloatArray | float = 1.0,
) -> FloatArray:
    """Return points (n, 3) that keep their position in the camera frame of a moving frame.

    Args:
        points: (n, 3) before the frames move.
        before, after: (F, 4, 4) world_T_camera.
        anchor: (n,) frame with which each point moves.
        scale: (n,) factor by which each point's distance from the camera grows.
    """
    turn = np.ascontiguousarray((after[:, :3, :3] @ before[:, :3, :3].transpose(0, 2, 1)).transpose(1, 2, 0))
    x, y, z = ((points[:, i] - before[:, i, 3][anchor]) * scale for i in range(3))
    moved = np.empty_like(points)
    for i in range(3):
        a, b, c = (turn[i, j].take(anchor) for j in range(3))
        moved[:, i] = a * x + b * y + c * z + after[:, i, 3][anchor]
    return moved


def landmark_costs(
    problem: BundleProblem, structure: SparsityStructure, *points: FloatArray
) -> list[FloatArray]:
    """Return the cost of each landmark's observations, (L,), with the landmarks at each of points (L, 3)."""
    costs = [np.zeros(len(problem.world_p_landmark)) for _ in points]

    def cost(chunk: Chunk) -> tuple[IntArray, list[FloatArray]]:
        return chunk.landmarks, _chunk_costs(problem, chunk, points)

    for landmarks, found in map_in_order(cost, structure.chunks):
        for all_costs, part in zip(costs, found, strict=True):
            all_costs[landmarks] = part
    return costs


def step_landmarks(
    problem: BundleProblem,
    before: BundleProblem,
    anchor: IntArray,
    step: FloatArray,
    structure: SparsityStructure,
) -> tuple[FloatArray, float]:
    """Move each landmark by its step or, if that is worse, with its anchor frame.

    Where it is clearly worse, the step in direction and inverse distance is tried as well, and the landmark
    refined by itself.

    Args:
        problem: Poses after the step, landmarks before it.
        before: Poses before the step.
        anchor: (L,) from :func:`anchor_frames`.
        step: (L, 3) steps of the landmarks.
        structure: Structure of the problem.

    Returns:
        The landmarks (L, 3), and the cost of all observations.
    """
    poses, points = problem.world_T_camera, problem.world_p_landmark
    stepped = points + step
    carried = move_with_frames(points, before.world_T_camera, poses, anchor)
    by_inverse = inverse_distance_step(points, step, before.world_T_camera, poses, anchor)
    cost, cost_carried = landmark_costs(problem, structure, stepped, carried)
    worse = cost > cost_carried  # false of NaN, whose total then rejects the whole step
    gap = np.where(worse, cost - cost_carried, 0.0)
    best = np.where(worse[:, None], carried, stepped)
    refined, gain = refine_landmarks(problem.moved(poses, best), gap > _MIN_LOSS, structure, by_inverse)
    return refined, float(np.where(worse, cost_carried, cost).sum()) - gain


def inverse_distance_step(
    points: FloatArray, step: FloatArray, before: FloatArray, after: FloatArray, anchor: IntArray
) -> FloatArray:
    """Return points (L, 3) after steps that are linear in direction and inverse distance from their frames.

    Pixels of a distant point are nearly linear in these, by no means in its position: the linear model may
    move a landmark at 20 km by thousands. What a landmark cannot follow is promised again in every
    iteration, and hides by how much the others gain. To first order these steps are straight.

    Args:
        points: (L, 3) before the step.
        step: (L, 3) of the linear model, metres.
        before, after: (F, 4, 4) world_T_camera.
        anchor: (L,) frame from which each distance counts.
    """
    centre, moved = before[:, :3, 3][anchor], after[:, :3, 3][anchor]
    ray = points - centre
    relative = step + centre - moved
    squared = np.maximum(np.sum(ray**2, axis=1), np.finfo(float).tiny)
    nearer = 1.0 - np.sum(relative * ray, axis=1) / squared  # inverse distance, over that before
    direction = ray * nearer[:, None] + relative  # of the distance before, to first order
    norm = np.maximum(np.linalg.norm(direction, axis=1), np.finfo(float).tiny)
    distance = np.sqrt(squared) / np.maximum(nearer, 1.0 / _MOST_FARTHER)
    return np.asarray(moved + direction * (distance / norm)[:, None])


def refine_landmarks(
    problem: BundleProblem, which: BoolArray, structure: SparsityStructure, other: FloatArray
) -> tuple[FloatArray, float]:
    """Refine landmarks by a few damped steps of their own; the cost of none of them rises.

    Args:
        problem: The poses, and a start of each landmark.
        which: (L,) landmarks to refine.
        structure: Structure of the problem; many landmarks are refined chunk by chunk, to save memory.
        other: (L, 3) another start of each landmark; the better one counts.

    Returns:
        All landmarks (L, 3), and the decrease of the cost.
    """
    points, cost = problem.world_p_landmark.copy(), np.zeros((2, len(which)))

    def refined(part: BundleProblem) -> tuple[IntArray, FloatArray, FloatArray]:
        here = part.moved(problem.world_T_camera, problem.world_p_landmark)
        return _refined(here.select_observations(np.flatnonzero(which[part.landmark])), other)

    few = np.count_nonzero(which[problem.landmark]) <= CHUNK_OBSERVATIONS
    by_chunk = map_in_order(lambda chunk: refined(chunk.problem), structure.chunks)
    for landmarks, found, costs in [refined(problem)] if few else by_chunk:
        points[landmarks], cost[:, landmarks] = found, costs
    before, after = cost[:, which]
    return points, float(before.sum()) - float(after.sum())


def _refined(problem: BundleProblem, other: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the observed landmarks (m,), their refined points (m, 3) and costs (2, m) before and after."""
    landmarks, landmark = numbered(problem.landmark)
    points = problem.world_p_landmark[landmarks]
    if not len(points):
        return landmarks, points, np.zeros((2, 0))
    problem = replace(problem, landmark=landmark, world_p_landmark=points).by_view()  # its poses stay, too
    chunk, damping = _chunk_of(problem), np.full(len(points), _START_DAMPING)
    other = other[landmarks]
    start, cost_other = _chunk_costs(problem, chunk, [points, other])
    points = np.where((cost_other < start)[:, None], other, points)
    cost = np.fmin(start, cost_other)
    for _ in range(_ITERATIONS):
        linear = linearise_chunk(problem.moved(problem.world_T_camera, points), chunk)
        factors = factorise_landmarks(linear, damping)
        trial = points - factors.transposed_times(factors.times(linear.gradient)).T
        (trial_cost,) = _chunk_costs(problem, chunk, [trial])
        better = trial_cost < cost
        points = np.where(better[:, None], trial, points)
        cost[better] = trial_cost[better]
        damping *= np.where(better, 0.1, 10.0)
    return landmarks, points, np.stack([start, cost])


def _chunk_costs(problem: BundleProblem, chunk: Chunk, points: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the cost of each of the chunk's landmarks, (m,), with all landmarks at each of points (L, 3)."""
    poses = problem.world_T_camera
    views = view_poses(chunk.problem.moved(poses, problem.world_p_landmark))
    costs = (observation_costs(chunk.problem.moved(poses, at), views) for at in points)
    size = len(chunk.landmarks)
    return [np.bincount(chunk.landmark, cost, size).astype(np.float64) for cost in costs]


def _chunk_of(problem: BundleProblem) -> Chunk:
    """Return a problem as a chunk without groups."""
    return Chunk(
        problem=problem,
        landmarks=np.arange(len(problem.world_p_landmark)),
        landmark=problem.landmark,
        first_frame=0,
        frame=problem.frame,
        coupled=couple(problem, problem.landmark),
        free_rows=np.zeros(0, dtype=np.int64),
        entry=np.zeros((0, 3), dtype=np.int64),
        groups=(),
    )

"""Points of a bundle problem one by one, the poses held: what they cost, and where each is best by itself.

A Levenberg-Marquardt step moves poses and points together by a linear model. For a few points, far ones or
such that are seen along nearly one ray, the model is wrong even for short steps; damped as a whole, the
system would creep for their sake. So each point takes its part of a step only if its own observations gain.
"""

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solver.elimination import Structure
from vgps.solver.landmark_groups import Chunk
from vgps.solver.normal_equations import factor_points, linearize_chunk
from vgps.solver.problem import BundleProblem, observation_costs

_NOTEWORTHY = 1e-3  # of cost, by which a step has to fail a point before that is moved by itself
_DAMPING = 1e-3
_ITERATIONS = 4


def anchors(problem: BundleProblem) -> IntArray:
    """(L,) the frame that saw each landmark last; 0 for one that none saw."""
    anchor = np.zeros(len(problem.world_p_landmark), dtype=np.int64)
    np.maximum.at(anchor, problem.landmark, problem.frame)
    return anchor


def carried(
    points: FloatArray,
    before: FloatArray,
    after: FloatArray,
    anchor: IntArray,
    scale: FloatArray | float = 1.0,
) -> FloatArray:
    """Points (n, 3) at the same place in the view of their frames, after these have moved.

    Args:
        points: Where they were.
        before, after: (F, 4, 4) poses.
        anchor: (n,) each point's frame.
        scale: (n,) by which each view grew.
    """
    old, new = before[anchor], after[anchor]
    in_camera = ((points - old[:, :3, 3])[:, None, :] @ old[:, :3, :3])[:, 0] * np.reshape(scale, (-1, 1))
    return np.asarray((new[:, :3, :3] @ in_camera[:, :, None])[:, :, 0] + new[:, :3, 3])


def landmark_costs(problem: BundleProblem, structure: Structure) -> FloatArray:
    """(L,) cost of each landmark's observations."""
    costs = np.zeros(len(problem.world_p_landmark))
    for chunk in structure.chunks:
        here = chunk.problem.moved(problem.world_T_camera, problem.world_p_landmark)
        costs[chunk.landmarks] = np.bincount(chunk.landmark, observation_costs(here), len(chunk.landmarks))
    return costs


def best_points(
    problem: BundleProblem, before: BundleProblem, anchor: IntArray, step: FloatArray, structure: Structure
) -> tuple[FloatArray, float]:
    """Each point where a step has it or, if that is worse, carried along and moved by itself.

    Args:
        problem: The poses after the step, the points as they were.
        before: The poses before it.
        anchor: (L,) :func:`anchors`.
        step: (L, 3) of the points.
        structure: Of the problem.

    Returns:
        (L, 3) the points, and what their observations cost.
    """
    poses, points = problem.world_T_camera, problem.world_p_landmark
    goes = problem.moved(poses, points + step)
    stays = problem.moved(poses, carried(points, before.world_T_camera, poses, anchor))
    cost, cost_stays = landmark_costs(goes, structure), landmark_costs(stays, structure)
    worse = cost > cost_stays  # false of NaN: then the whole step is refused
    gap = np.where(worse, cost - cost_stays, 0.0)
    best = np.where(worse[:, None], stays.world_p_landmark, goes.world_p_landmark)
    found, gain = settled(problem.moved(poses, best), gap > _NOTEWORTHY)
    return found, float(np.where(worse, cost_stays, cost).sum()) - gain


def settled(problem: BundleProblem, which: BoolArray) -> tuple[FloatArray, float]:
    """Points after a few damped steps, each of its own; no point's cost is higher than before.

    Args:
        problem: The poses, and where to begin.
        which: (L,) points that move.

    Returns:
        (L, 3) all points, and by how much the cost is lower.
    """
    rows = np.flatnonzero(which[problem.landmark])
    points = problem.world_p_landmark.copy()
    if not len(rows):
        return points, 0.0
    chunk = _seen(problem, rows)
    own = chunk.landmarks
    damping = np.full(len(own), _DAMPING)
    cost = _costs(problem, chunk)
    at_first = float(cost.sum())
    for _ in range(_ITERATIONS):
        linear = linearize_chunk(problem.moved(problem.world_T_camera, points), chunk)
        factor = factor_points(linear, damping)
        trial = points.copy()
        trial[own] -= factor.transposed_times(factor.times(linear.gradient)).T
        trial_cost = _costs(problem.moved(problem.world_T_camera, trial), chunk)
        better = trial_cost < cost
        points[own[better]], cost[better] = trial[own[better]], trial_cost[better]
        damping *= np.where(better, 0.1, 10.0)
    return points, at_first - float(cost.sum())


def _costs(problem: BundleProblem, chunk: Chunk) -> FloatArray:
    losses = observation_costs(chunk.problem.moved(problem.world_T_camera, problem.world_p_landmark))
    return np.bincount(chunk.landmark, losses, len(chunk.landmarks)).astype(np.float64)


def _seen(problem: BundleProblem, rows: IntArray) -> Chunk:
    """These observations, without blocks."""
    here = problem.only(rows)
    own, landmark = np.unique(here.landmark, return_inverse=True)
    none = np.zeros(0, dtype=np.int64)
    return Chunk(here, own, landmark, 0, here.frame, none, np.zeros((0, 3), dtype=np.int64), ())

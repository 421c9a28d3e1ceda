"""GTSAM's own optimiser: the reference, and the way out where the engine does not fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L

from vgps.solver.gtsam_export import to_graph
from vgps.solver.levenberg_marquardt import LIGHT_DAMPING, Outcome, SolverSettings
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True)
class GtsamOutcome:
    """Where GTSAM ended: values never of a higher error than the start's; flags as of :class:`Outcome`."""

    values: gtsam.Values
    iterations: int
    reason: str
    converged: bool
    stuck: bool


def optimise_with_gtsam(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, order: Sequence[int], settings: SolverSettings
) -> GtsamOutcome:
    """GTSAM's Levenberg-Marquardt from the same settings.

    Args:
        graph: What to minimise.
        values: Start, for every variable of the graph.
        order: Keys in order of their elimination.
        settings: When to stop, and how to damp.
    """
    if not graph.size():
        return GtsamOutcome(values, 0, "converged: there is nothing to move", True, False)
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, _gtsam_parameters(order, settings))
    start = optimizer.error()
    try:
        result = optimizer.optimize()
    except RuntimeError as error:
        said = str(error).strip().splitlines() or ["no reason given"]
        return GtsamOutcome(values, 0, f"GTSAM gave up: {said[0]}", False, True)
    end, iterations = graph.error(result), optimizer.iterations()
    if not end < start:
        minimum = optimizer.lambda_() <= LIGHT_DAMPING  # else the damping rose in vain
        reason = "converged: the start is a minimum" if minimum else "no step lowers the cost"
        return GtsamOutcome(values, 0, reason, minimum, not minimum)
    full = iterations >= settings.max_iterations
    reason = (
        f"stopped after {iterations} iterations" if full else "converged: GTSAM's tolerances were reached"
    )
    return GtsamOutcome(result, iterations, reason, not full, False)


def levenberg_of_gtsam(problem: BundleProblem, settings: SolverSettings) -> Outcome:
    """The same for a bundle problem, landmarks eliminated first."""
    graph, values = to_graph(problem)
    order = [L(landmark) for landmark in np.unique(problem.landmark).tolist()]
    order += [key for key in problem.keys.tolist() if values.exists(key)]
    order += sorted(problem.shared)
    found = optimise_with_gtsam(graph, values, order, settings)
    moved = problem if found.values is values else _with_values(problem, found.values)
    return Outcome(moved, found.iterations, found.reason, found.converged, found.stuck)


def _gtsam_parameters(order: Sequence[int], settings: SolverSettings) -> gtsam.LevenbergMarquardtParams:
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setLinearSolverType("MULTIFRONTAL_CHOLESKY")
    parameters.setMaxIterations(settings.max_iterations)
    parameters.setRelativeErrorTol(settings.relative_tolerance)
    parameters.setAbsoluteErrorTol(settings.absolute_tolerance)
    parameters.setlambdaInitial(settings.lambda_start)
    parameters.setlambdaFactor(settings.lambda_factor)
    parameters.setlambdaUpperBound(settings.lambda_most)
    parameters.setDiagonalDamping(True)
    ordering = gtsam.Ordering()
    for key in order:
        ordering.push_back(key)
    parameters.setOrdering(ordering)
    return parameters


def _with_values(problem: BundleProblem, values: gtsam.Values) -> BundleProblem:
    world_T_camera, world_p_landmark = problem.world_T_camera.copy(), problem.world_p_landmark.copy()
    for frame in np.flatnonzero(~problem.fixed_frames).tolist():
        key = int(problem.keys[frame])
        if values.exists(key):
            world_T_camera[frame] = values.atPose3(key).matrix()
    for landmark in np.unique(problem.landmark).tolist():
        world_p_landmark[landmark] = values.atPoint3(L(landmark))
    shared = {key: values.atVector(key) for key in problem.shared}
    return problem.moved(world_T_camera, world_p_landmark, shared)

"""GTSAM's own Levenberg-Marquardt: the reference, and the fallback where the sparse engine does not apply."""

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L

from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.gtsam_values import vectors_at
from vgps.solver.levenberg_marquardt import LIGHT_DAMPING, SolverSettings, Termination
from vgps.solver.problem import BundleProblem


def optimise_with_gtsam(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, order: Sequence[int], settings: SolverSettings
) -> tuple[gtsam.Values, Termination]:
    """Run GTSAM's Levenberg-Marquardt with these settings.

    Args:
        graph: The cost.
        values: Start, for every variable of the graph.
        order: Keys in order of elimination.
        settings: Stopping criteria and damping.

    Returns:
        Values whose error is never above that of the start, and how the optimiser ended.
    """
    if not graph.size():
        return values, Termination(0, "converged: there are no factors", converged=True)
    optimiser = gtsam.LevenbergMarquardtOptimizer(graph, values, _parameters(order, settings))
    start = optimiser.error()
    try:
        result = optimiser.optimize()
    except RuntimeError as error:
        lines = str(error).strip().splitlines() or ["no reason given"]
        return values, Termination(0, f"GTSAM failed: {lines[0]}", stuck=True)
    iterations = optimiser.iterations()
    if not graph.error(result) < start:
        if optimiser.lambda_() <= LIGHT_DAMPING:
            return values, Termination(0, "converged: the start is a minimum", converged=True)
        return values, Termination(0, "no step lowers the cost", stuck=True)
    if iterations >= settings.max_iterations:
        return result, Termination(iterations, f"stopped after {iterations} iterations")
    return result, Termination(iterations, "converged: GTSAM's tolerances were reached", converged=True)


def solve_with_gtsam(problem: BundleProblem, settings: SolverSettings) -> tuple[BundleProblem, Termination]:
    """Run GTSAM's Levenberg-Marquardt on a bundle problem: landmarks first, shared vectors last."""
    graph, values = to_graph(problem)
    order = [L(landmark) for landmark in np.unique(problem.landmark).tolist()]
    frame = dict(zip(problem.keys.tolist(), range(len(problem.keys)), strict=True))
    frame |= {key: state.frame for key, state in problem.states.items()}
    order += [key for key in sorted(frame, key=frame.__getitem__) if values.exists(key)]
    order += sorted(problem.shared)
    result, end = optimise_with_gtsam(graph, values, order, settings)
    return problem if result is values else _with_values(problem, result), end


def _parameters(order: Sequence[int], settings: SolverSettings) -> gtsam.LevenbergMarquardtParams:
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setLinearSolverType("MULTIFRONTAL_CHOLESKY")
    parameters.setMaxIterations(settings.max_iterations)
    parameters.setRelativeErrorTol(settings.relative_tolerance)
    parameters.setAbsoluteErrorTol(settings.absolute_tolerance)
    parameters.setlambdaInitial(settings.lambda_start)
    parameters.setlambdaFactor(settings.lambda_factor)
    parameters.setlambdaUpperBound(settings.lambda_max)
    parameters.setDiagonalDamping(True)
    ordering = gtsam.Ordering()
    for key in order:
        ordering.push_back(key)
    parameters.setOrdering(ordering)
    return parameters


def _with_values(problem: BundleProblem, values: gtsam.Values) -> BundleProblem:
    """Return the problem at the values; held poses stay unchanged to the last bit."""
    world_T_camera, world_p_landmark = problem.world_T_camera.copy(), problem.world_p_landmark.copy()
    for frame in np.flatnonzero(~problem.fixed_frames).tolist():
        key = int(problem.keys[frame])
        if values.exists(key):
            world_T_camera[frame] = values.atPose3(key).matrix()
    for landmark in np.unique(problem.landmark).tolist():
        world_p_landmark[landmark] = values.atPoint3(L(landmark))
    return problem.moved(world_T_camera, world_p_landmark, *vectors_at(values, problem))

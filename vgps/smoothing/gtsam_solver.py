"""The same problem handed to GTSAM's optimiser: the reference, and the way out where the band is no band."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L

from vgps.smoothing.bundle import BundleProblem, to_graph
from vgps.smoothing.levenberg import LIGHT_DAMPING, Outcome, SolverSettings


def levenberg_of_gtsam(problem: BundleProblem, settings: SolverSettings) -> Outcome:
    """GTSAM's Levenberg-Marquardt from the same settings, landmarks eliminated first."""
    graph, values = to_graph(problem)
    if not values.size():
        return Outcome(problem, 0, "converged: there is nothing to move", True, False)
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, _gtsam_parameters(problem, values, settings))
    start = optimizer.error()
    try:
        result = optimizer.optimize()
    except RuntimeError as error:
        return Outcome(problem, 0, f"GTSAM gave up: {str(error).strip().splitlines()[0]}", False, True)
    end, iterations = graph.error(result), optimizer.iterations()
    if not end < start:
        minimum = optimizer.lambda_() <= LIGHT_DAMPING  # else the damping rose in vain
        reason = "converged: the start is a minimum" if minimum else "no step lowers the cost"
        return Outcome(problem, 0, reason, minimum, not minimum)
    full = iterations >= settings.max_iterations
    reason = (
        f"stopped after {iterations} iterations" if full else "converged: GTSAM's tolerances were reached"
    )
    return Outcome(_with_values(problem, result), iterations, reason, not full, False)


def _gtsam_parameters(
    problem: BundleProblem, values: gtsam.Values, settings: SolverSettings
) -> gtsam.LevenbergMarquardtParams:
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
    for landmark in np.unique(problem.landmark).tolist():
        ordering.push_back(L(landmark))
    for key in problem.keys.tolist():
        if values.exists(key):
            ordering.push_back(key)
    for key in sorted(problem.shared):
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

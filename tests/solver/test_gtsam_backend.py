from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from synthetic_bundle import TIGHT, drive, held_frames, total_cost, wrong_sign_factor

from vgps.solver.gtsam_backend import optimise_with_gtsam, solve_with_gtsam
from vgps.solver.levenberg_marquardt import SolverSettings, Termination


def one_pose(translation: list[float]) -> gtsam.Values:
    values = gtsam.Values()
    values.insert(X(0), gtsam.Pose3(gtsam.Rot3(), np.array(translation)))
    return values


def prior_at_origin() -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    graph.addPriorPose3(X(0), gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6))
    return graph


def test_quadratic_cost_is_minimised() -> None:
    result, end = optimise_with_gtsam(prior_at_origin(), one_pose([1.0, 2.0, 3.0]), [X(0)], SolverSettings())
    assert end.converged and not end.stuck and end.iterations >= 1
    np.testing.assert_allclose(result.atPose3(X(0)).translation(), 0.0, atol=1e-4)


def test_empty_graph_returns_the_start() -> None:
    start = one_pose([1.0, 0.0, 0.0])
    result, end = optimise_with_gtsam(gtsam.NonlinearFactorGraph(), start, [], SolverSettings())
    assert result is start and end == Termination(0, "converged: there are no factors", converged=True)


def test_start_at_the_minimum_returns_the_start() -> None:
    start = one_pose([0.0, 0.0, 0.0])
    result, end = optimise_with_gtsam(prior_at_origin(), start, [X(0)], SolverSettings())
    assert result is start and end.converged and end.iterations == 0


def test_wrong_jacobian_is_stuck_at_the_start() -> None:
    start = one_pose([0.0, 0.0, 0.0])
    result, end = optimise_with_gtsam(wrong_sign_factor(), start, [X(0)], SolverSettings())
    assert result is start
    assert end == Termination(0, "no step lowers the cost", stuck=True)


def test_failure_of_gtsam_is_reported_with_its_reason() -> None:
    """A factor that throws as soon as it is linearised."""

    def error(_: gtsam.CustomFactor, __: gtsam.Values, jacobians: list | None) -> np.ndarray:
        if jacobians is not None:
            raise RuntimeError("no derivative")
        return np.ones(3)

    graph = prior_at_origin()
    graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(3), [X(0)], error))
    start = one_pose([1.0, 0.0, 0.0])
    result, end = optimise_with_gtsam(graph, start, [X(0)], SolverSettings())
    assert result is start and end.stuck
    assert end.reason.startswith("GTSAM failed: ") and "no derivative" in end.reason


def test_iteration_limit_is_reported() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    _, end = solve_with_gtsam(problem, replace(TIGHT, max_iterations=1))
    assert end == Termination(1, "stopped after 1 iterations")


@pytest.mark.slow
@pytest.mark.parametrize("shared", [True, False])
def test_bundle_problem_is_moved_to_the_minimum(shared: bool) -> None:
    problem = held_frames()
    if shared:
        graph = gtsam.NonlinearFactorGraph(problem.pose_graph)
        graph.push_back(gtsam.PriorFactorVector(5, np.array([2.0]), gtsam.noiseModel.Unit.Create(1)))
        problem = replace(problem, pose_graph=graph, shared={5: np.zeros(1)})
    solved, end = solve_with_gtsam(problem, TIGHT)
    assert end.converged and total_cost(solved) < 0.25 * total_cost(problem)
    assert problem.fixed is not None
    np.testing.assert_array_equal(solved.world_T_camera[problem.fixed], problem.world_T_camera[problem.fixed])
    if shared:
        np.testing.assert_allclose(solved.shared[5], [2.0], atol=1e-6)

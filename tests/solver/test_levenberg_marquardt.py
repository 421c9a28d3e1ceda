from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from synthetic_bundle import TIGHT, drive, held_frames, keep_observations, total_cost, wrong_sign_factor

from vgps.solver import levenberg_marquardt
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.iterate import iterate_at
from vgps.solver.levenberg_marquardt import SolverSettings, Termination, minimise
from vgps.solver.problem import BundleProblem


def run(problem: BundleProblem, settings: SolverSettings = TIGHT) -> tuple[BundleProblem, Termination]:
    structure = analyse_sparsity(problem)
    best, end = minimise(iterate_at(problem, structure), structure, settings)
    return best.problem, end


def poses_only(graph: gtsam.NonlinearFactorGraph, frames: int = 1) -> BundleProblem:
    """Return a problem of identity poses without observations."""
    problem, _ = drive(frames=max(frames, 10), landmarks=20)
    problem = keep_observations(problem, np.zeros(len(problem.frame), dtype=bool))
    return replace(
        problem, world_T_camera=np.tile(np.eye(4), (len(problem.world_T_camera), 1, 1)), pose_graph=graph
    )


def test_quadratic_cost_takes_one_step() -> None:
    """The only factor is a fix: the cost is quadratic in the translation."""
    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.GPSFactor(X(0), np.array([1.0, 2.0, 3.0]), gtsam.noiseModel.Isotropic.Sigma(3, 0.1)))
    settings = SolverSettings(lambda_start=1e-12, max_iterations=1)
    solved, end = run(poses_only(graph), settings)
    np.testing.assert_allclose(solved.world_T_camera[0, :3, 3], [1.0, 2.0, 3.0], atol=1e-6)
    assert end == Termination(1, "stopped after 1 iterations")


def test_cost_falls_with_every_step() -> None:
    problem, _ = drive(frames=12, landmarks=80)
    costs = [total_cost(run(problem, replace(TIGHT, max_iterations=n))[0]) for n in range(1, 5)]
    assert all(after < before for before, after in zip([total_cost(problem), *costs], costs, strict=False))


def test_minimum_is_recognised_without_a_step() -> None:
    best, _ = run(drive(frames=12, landmarks=80)[0])
    again, end = run(best, SolverSettings())
    assert end.converged and end.iterations <= 1 and end.reason.startswith("converged")
    assert total_cost(again) <= total_cost(best)


def test_wrong_jacobian_is_stuck_at_the_start() -> None:
    problem = poses_only(wrong_sign_factor())
    solved, end = run(problem, SolverSettings())
    assert end.stuck and not end.converged and end.iterations == 0
    assert end.reason.startswith("no step lowers the cost, with a damping of up to")
    np.testing.assert_array_equal(solved.world_T_camera, problem.world_T_camera)


def test_held_poses_do_not_move_by_a_bit() -> None:
    problem = held_frames()
    solved, _ = run(problem, replace(TIGHT, max_iterations=2))
    assert problem.fixed is not None
    np.testing.assert_array_equal(solved.world_T_camera[problem.fixed], problem.world_T_camera[problem.fixed])
    assert not np.array_equal(solved.world_T_camera, problem.world_T_camera)


def test_damping_bounds_the_step() -> None:
    problem, _ = drive(frames=12, landmarks=80)

    def step_m(damping: float) -> float:
        solved, _ = run(problem, replace(TIGHT, lambda_start=damping, max_iterations=1))
        return float(np.linalg.norm(solved.world_T_camera[:, :3, 3] - problem.world_T_camera[:, :3, 3]))

    assert step_m(1e3) < 0.02 * step_m(1e-6)


def test_step_that_overshoots_is_shortened(monkeypatch: pytest.MonkeyPatch) -> None:
    """The Jacobian is a third of the true one, so that the full step goes three times too far."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: list | None) -> np.ndarray:
        if jacobians is not None:
            jacobians[0] = np.asfortranarray(np.hstack([np.zeros((3, 3)), np.eye(3) / 3.0]))
        return values.atPose3(this.keys()[0]).translation() - np.array([1.0, 0.0, 0.0])

    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(3), [X(0)], error))
    settings = SolverSettings(lambda_start=1e-12, max_iterations=1)
    solved, _ = run(poses_only(graph), settings)
    np.testing.assert_allclose(solved.world_T_camera[0, :3, 3], [1.5, 0.0, 0.0], atol=1e-6)
    # without shorter steps the overshooting one is refused and damped until it is short enough
    monkeypatch.setattr(levenberg_marquardt, "_STEP_FRACTIONS", (1.0,))
    solved, _ = run(poses_only(graph), settings)
    assert 0.0 < solved.world_T_camera[0, 0, 3] < 2.0


def test_step_that_is_far_too_short_is_lengthened() -> None:
    """A row without an error claims seven times the true curvature: the step is an eighth of the way."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: list | None) -> np.ndarray:
        if jacobians is not None:
            rows = np.vstack([np.eye(3), np.sqrt(7.0) * np.eye(3)])
            jacobians[0] = np.asfortranarray(np.hstack([np.zeros((6, 3)), rows]))
        offset = values.atPose3(this.keys()[0]).translation() - np.array([1.0, 0.0, 0.0])
        return np.concatenate([offset, np.zeros(3)])

    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(6), [X(0)], error))
    solved, _ = run(poses_only(graph), SolverSettings(lambda_start=1e-12, max_iterations=1))
    np.testing.assert_allclose(solved.world_T_camera[0, :3, 3], [1.0, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize(("cost", "expected"), [(1e6, 1.0), (1.0, 1e-3)])
def test_tolerance_is_the_larger_of_relative_and_absolute(cost: float, expected: float) -> None:
    settings = SolverSettings(relative_tolerance=1e-6, absolute_tolerance=1e-3)
    assert settings.tolerance(cost) == pytest.approx(expected)

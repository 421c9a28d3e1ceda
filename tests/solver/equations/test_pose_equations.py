from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import A, B, X
from synthetic_bundle import ANTENNA, drive

from factors import Gaussian, gps_factor_calibrating
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.pose_equations import Border, linearise_pose_graph, whitened_jacobian
from vgps.solver.gtsam_values import all_pose_values, pose_values
from vgps.solver.matrices.band_matrix import BandMatrix
from vgps.solver.problem import BundleProblem


def with_sensors(fixed: list[int] | None = None) -> BundleProblem:
    """Return a problem with a time offset and an antenna, whose keys come before those of the poses."""
    problem, poses = drive(frames=8, landmarks=40)
    graph = gtsam.NonlinearFactorGraph(problem.pose_graph)
    penalty, velocity = Gaussian((0.1, 0.1, 0.2)), np.array([0.1, -0.2, 0.6])
    for i in range(6):
        keys = (X(i), X(i + 1)), (A(0), B(0))
        graph.push_back(gps_factor_calibrating(*keys, 0.4, poses[i, :3, 3], velocity, penalty))
    return replace(
        problem,
        pose_graph=graph,
        shared={A(0): np.array([0.1]), B(0): ANTENNA},
        fixed=None if fixed is None else np.isin(np.arange(8), fixed),
    )


def gtsam_system(problem: BundleProblem) -> tuple[np.ndarray, np.ndarray]:
    """Return J^T J and J^T r by GTSAM: poses in order, then time offset and antenna."""
    ordering = gtsam.Ordering()
    for key in [*map(X, range(8)), A(0), B(0)]:
        ordering.push_back(key)
    H, g = problem.pose_graph.linearize(pose_values(problem)).hessian(ordering)
    return H, -g


def test_normal_equations_equal_those_of_gtsam() -> None:
    problem = with_sensors()
    H, g = gtsam_system(problem)
    hessian, gradient, border = linearise_pose_graph(
        problem, all_pose_values(problem), analyse_sparsity(problem)
    )
    scale = np.abs(H).max()
    np.testing.assert_allclose(hessian.toarray(), np.tril(H[:48, :48]), atol=1e-12 * scale)
    np.testing.assert_allclose(gradient, g[:48], atol=1e-10 * np.abs(g).max())
    np.testing.assert_allclose(border.coupling, H[:48, 48:], atol=1e-12 * scale)
    np.testing.assert_allclose(border.hessian, H[48:, 48:], atol=1e-12 * scale)
    np.testing.assert_allclose(border.gradient, g[48:], atol=1e-10 * np.abs(g).max())


def test_columns_of_held_poses_are_left_out() -> None:
    problem = with_sensors(fixed=[0, 5])
    H, _ = gtsam_system(problem)
    hessian, _, border = linearise_pose_graph(problem, all_pose_values(problem), analyse_sparsity(problem))
    free = np.concatenate([6 * i + np.arange(6) for i in (1, 2, 3, 4, 6, 7)])
    np.testing.assert_allclose(
        hessian.toarray(), np.tril(H[np.ix_(free, free)]), atol=1e-12 * np.abs(H).max()
    )
    assert border.coupling.shape == (36, 4)


def test_jacobian_of_some_factors_has_all_columns() -> None:
    problem = with_sensors()
    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.GPSFactor(X(3), np.array([1.0, 2.0, 3.0]), gtsam.noiseModel.Isotropic.Sigma(3, 0.5)))
    J, b = whitened_jacobian(problem, graph, all_pose_values(problem), analyse_sparsity(problem))
    assert J.shape == (3, 52)
    pose = problem.world_T_camera[3]
    np.testing.assert_allclose(J.toarray()[:, 21:24], pose[:3, :3] / 0.5)
    np.testing.assert_allclose(b, -(pose[:3, 3] - [1.0, 2.0, 3.0]) / 0.5)
    empty, nothing = whitened_jacobian(
        problem, gtsam.NonlinearFactorGraph(), all_pose_values(problem), analyse_sparsity(problem)
    )
    assert empty.shape == (0, 52) and len(nothing) == 0


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_border_is_solved_with_the_poses(damping: float) -> None:
    rng = np.random.default_rng(0)
    J = rng.normal(size=(40, 15))
    H, g = J.T @ J, rng.normal(size=15)
    band = BandMatrix.zeros(12, 13)
    band.add_lower(0, np.tril(H[:12, :12]))
    border = Border(H[:12, 12:], H[12:, 12:], g[12:])
    solution = border.eliminate(band.cholesky(11), g[:12], damping)
    damped = H + np.diag(np.append(np.zeros(12), damping * np.diag(H)[12:]))
    expected = -np.linalg.solve(damped, g)
    np.testing.assert_allclose(np.append(solution.pose_step, solution.shared_step), expected, atol=1e-10)
    np.testing.assert_allclose(
        np.linalg.inv(solution.complement), np.linalg.inv(damped)[12:, 12:], atol=1e-10
    )
    np.testing.assert_allclose(H[:12, :12] @ solution.pose_by_shared, border.coupling, atol=1e-9)

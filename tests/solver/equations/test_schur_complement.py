from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, X
from synthetic_bundle import drive, one_point, with_loss
from synthetic_states import drive_with_states

from vgps.solver.equations.elimination import SparsityStructure, analyse_sparsity
from vgps.solver.equations.normal_equations import Linearisation, linearise
from vgps.solver.equations.schur_complement import (
    LandmarkFactors,
    factorise_landmarks,
    landmark_steps,
    pose_scores,
    reduce_to_poses,
)
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem


def linearized(problem: BundleProblem) -> tuple[Linearisation, SparsityStructure]:
    structure = analyse_sparsity(problem)
    return linearise(problem, all_pose_values(problem), structure), structure


def dense(factors: LandmarkFactors) -> np.ndarray:
    """Return the factors M as (m, 3, 3)."""
    M = np.zeros((factors.m.shape[1], 3, 3))
    M[:, *np.tril_indices(3)] = factors.m.T
    return M


def test_reduced_matrix_and_gradient_equal_those_of_gtsam() -> None:
    problem = with_loss(drive(frames=8, landmarks=60, outliers=0.1)[0], "huber")
    graph, values = to_graph(problem)
    landmarks = np.unique(problem.landmark)
    ordering = gtsam.Ordering()
    for key in [*map(L, landmarks.tolist()), *map(X, range(8))]:
        ordering.push_back(key)
    H, g = graph.linearize(values).hessian(ordering)
    n = 3 * len(landmarks)
    coupling = np.linalg.solve(H[:n, :n], H[:n, n:])
    expected, expected_gradient = H[n:, n:] - H[n:, :n] @ coupling, -(g[n:] - coupling.T @ g[:n])

    structure = analyse_sparsity(problem)
    band, gradient = reduce_to_poses(linearise(problem, values, structure), structure, 0.0)
    rows, columns = np.tril_indices(48)
    inside = rows - columns <= structure.half_bandwidth
    rows, columns = rows[inside], columns[inside]
    scale = np.sqrt(np.diag(expected))
    difference = (band.ab[rows - columns, columns] - expected[rows, columns]) / scale[rows] / scale[columns]
    np.testing.assert_allclose(difference, 0.0, atol=1e-9)
    np.testing.assert_allclose(gradient / scale, expected_gradient / scale, atol=1e-7)


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_landmark_factors_invert_the_damped_blocks(damping: float) -> None:
    linear, _ = linearized(drive(frames=12, landmarks=60)[0])
    (part,) = linear.chunks
    V = np.zeros((part.hessian.shape[1], 3, 3))
    V[:, *np.tril_indices(3)] = part.hessian.T
    V = np.tril(V) + np.tril(V, -1).transpose(0, 2, 1)
    V[:, range(3), range(3)] += damping * part.diagonal.T
    factors = factorise_landmarks(part, damping)
    M = dense(factors)
    np.testing.assert_allclose(M @ V @ M.transpose(0, 2, 1), np.broadcast_to(np.eye(3), V.shape), atol=1e-8)
    v = np.random.default_rng(0).normal(size=(3, len(V)))
    np.testing.assert_allclose(factors.times(v), np.einsum("mij,jm->im", M, v), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        factors.transposed_times(v), np.einsum("mji,jm->im", M, v), rtol=1e-12, atol=1e-12
    )


def test_landmark_observed_once_keeps_its_depth() -> None:
    """Its block is singular along the ray; the shortest of the steps that fit the observation is taken."""
    linear, _ = linearized(one_point([1.0, 2.0, 4.0], [440.0, 498.0]))
    (part,) = linear.chunks
    assert np.isfinite(factorise_landmarks(part, 0.0).m).all()
    factors = factorise_landmarks(part, 1e-6)
    step = -factors.transposed_times(factors.times(part.gradient))[:, 0]
    np.testing.assert_allclose(part.jl[:, :, 0] @ step, -part.r[:, 0], rtol=1e-4)
    ray, scaled = np.array([1.0, 2.0, 4.0]), part.diagonal[:, 0] * step
    assert abs(scaled @ ray) < 1e-3 * np.linalg.norm(scaled) * np.linalg.norm(ray)


def test_rounding_errors_in_the_depth_of_a_far_landmark_are_no_information() -> None:
    """It then absorbs no more of the residuals than there is: ``J V^-1 J^T`` has no eigenvalue above one."""
    rng = np.random.default_rng(0)
    depth = rng.normal(size=(20_000, 3))
    depth *= 10.0 ** rng.uniform(-6, 0, depth.shape)  # many near a coordinate plane
    across = np.linalg.svd(depth[:, None])[2][:, 1:]  # no residual moves with the depth
    jl = 1e-4 * rng.normal(size=(20_000, 8, 2)) @ across
    V = jl.transpose(0, 2, 1) @ jl
    (part,) = linearized(one_point([1.0, 2.0, 4.0], [440.0, 498.0]))[0].chunks
    M = dense(factorise_landmarks(replace(part, hessian=V[:, *np.tril_indices(3)].T), 0.0))
    absorbed = M @ jl.transpose(0, 2, 1)
    shares = np.linalg.eigvalsh(absorbed @ absorbed.transpose(0, 2, 1))
    assert shares.max() < 1.0 + 1e-3
    assert shares[:, 1:].min() > 0.8  # and hardly less


def test_steps_of_poses_and_landmarks_solve_the_whole_system() -> None:
    problem = with_loss(drive(frames=8, landmarks=60, outliers=0.1)[0], "huber")
    graph, values = to_graph(problem)
    landmarks = np.unique(problem.landmark)
    ordering = gtsam.Ordering()
    for key in [*map(X, range(8)), *map(L, landmarks.tolist())]:
        ordering.push_back(key)
    H, g = graph.linearize(values).hessian(ordering)
    expected = np.linalg.solve(H, g)
    linear, structure = linearized(problem)
    matrix, gradient = reduce_to_poses(linear, structure, 0.0)
    poses = -structure.cholesky(matrix).solve(gradient)
    np.testing.assert_allclose(poses, expected[:48], rtol=1e-6, atol=1e-9)
    points = landmark_steps(linear, poses.reshape(8, 6), 0.0)[:, landmarks]
    np.testing.assert_allclose(points.T.ravel(), expected[48:], rtol=1e-5, atol=1e-7)


def test_scores_of_the_observations_add_up_to_the_reduced_gradient() -> None:
    problem, _ = drive(frames=8, landmarks=60)
    linear, structure = linearized(problem)
    total = np.zeros((8, 6))
    for part in linear.chunks:
        np.add.at(total, part.chunk.first_frame + part.chunk.frame, pose_scores(part).T)
    # the pose factors have a gradient of their own
    video = linear.gradient - _pose_factor_gradient(problem)
    expected = video - (linear.gradient - reduce_to_poses(linear, structure, 0.0)[1])
    np.testing.assert_allclose(total.ravel(), expected, rtol=1e-9, atol=1e-7 * np.abs(expected).max())


def _pose_factor_gradient(problem: BundleProblem) -> np.ndarray:
    ordering = gtsam.Ordering()
    for key in map(X, range(8)):
        ordering.push_back(key)
    return -problem.pose_graph.linearize(all_pose_values(problem)).hessian(ordering)[1]


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_gradient_of_states_and_step_of_the_whole_system_equal_those_of_gtsam(held: bool) -> None:
    problem = drive_with_states(held)
    graph, values = to_graph(replace(problem, fixed=None))
    moved = [*problem.keys[~problem.fixed_frames].tolist(), *problem.states, *problem.shared]
    ordering = gtsam.Ordering()
    landmarks = np.unique(problem.landmark)
    first = [*moved, *map(L, landmarks.tolist())]
    for key in [*first, *problem.keys[problem.fixed_frames].tolist()]:
        ordering.push_back(key)
    H, g = graph.linearize(values).hessian(ordering)
    sizes = [6] * int((~problem.fixed_frames).sum()) + [len(s.vector) for s in problem.states.values()]
    unknown = sum(sizes) + 2 + 3 * len(landmarks)
    expected = np.split(np.linalg.solve(H[:unknown, :unknown], g[:unknown]), np.cumsum([*sizes, 2]))
    linear, structure = linearized(problem)
    matrix, gradient = reduce_to_poses(linear, structure, 0.0)
    step, shared, _, _ = linear.border.eliminate(structure.cholesky(matrix), gradient, 0.0)
    assert len(step) == 6 * structure.n_free
    at = 6 * structure.places(problem, moved[:-1])
    ours = [step[begin : begin + size] for begin, size in zip(at.tolist(), sizes, strict=True)]
    for found, by_gtsam in zip([*ours, shared], expected[:-1], strict=True):
        np.testing.assert_allclose(found, by_gtsam, rtol=1e-5, atol=1e-8)
    slopes = np.split(-g[:unknown], np.cumsum([*sizes, 2]))[:-2]
    for begin, slope in zip(at.tolist(), slopes, strict=True):
        np.testing.assert_allclose(
            linear.gradient[begin : begin + len(slope)], slope, rtol=1e-9, atol=1e-7 * np.abs(g).max()
        )
    assert not np.any(step[structure.padding(problem)])

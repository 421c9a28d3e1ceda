from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, X
from synthetic_bundle import drive, pose_factors, true_poses

from vgps.errors import GeometryError
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.cost import cost_terms
from vgps.solver.elimination import analyze_sparsity
from vgps.solver.gtsam_export import to_graph
from vgps.solver.marginals import marginal_covariances
from vgps.solver.normal_equations import linearize
from vgps.solver.problem import BundleProblem, all_pose_values
from vgps.solver.schur_complement import reduce_to_poses

TIGHT = SolverSettings(relative_tolerance=1e-13, absolute_tolerance=1e-13)


def only(problem: BundleProblem, keep: np.ndarray) -> BundleProblem:
    """The problem with some of its observations, and its pose factors."""
    return replace(problem.select_observations(keep), pose_graph=problem.pose_graph, shared=problem.shared)


def robust(problem: BundleProblem, loss: str) -> BundleProblem:
    return replace(problem, robust=loss, robust_k=np.full(len(problem.frame), 1.0))


def views(problem: BundleProblem) -> np.ndarray:
    """(N,) how often each observation's landmark is seen."""
    return np.bincount(problem.landmark)[problem.landmark]


def total(problem: BundleProblem) -> float:
    return sum(cost_terms(problem).values())


def gap() -> BundleProblem:
    problem, _ = drive()
    problem = only(problem, (problem.frame < 15) | (problem.frame > 22))
    return only(problem, views(problem) >= 3)


def held() -> BundleProblem:
    problem, poses = drive()
    start = problem.world_T_camera.copy()
    start[:12] = poses[:12]
    return replace(problem, world_T_camera=start, fixed=np.isin(np.arange(40), [*range(12), 30]))


def one_view_each() -> BundleProblem:
    """Some landmarks seen once: they say nothing, and must do no harm."""
    problem, _ = drive()
    _, first = np.unique(problem.landmark, return_index=True)
    is_first = np.isin(np.arange(len(problem.frame)), first)
    return only(problem, is_first | (problem.landmark % 5 != 0))


def sparse_tracks() -> BundleProblem:
    """Landmarks seen again after a long time, and in every third frame only."""
    problem, _ = drive()
    problem = only(problem, (problem.landmark % 2 == 0) | (problem.frame % 3 == 0))
    return only(problem, views(problem) >= 3)


CASES = {
    "plain": lambda: drive()[0],
    "huber": lambda: robust(drive(outliers=0.05)[0], "huber"),
    "cauchy": lambda: robust(drive(outliers=0.05, disturbed=0.3)[0], "cauchy"),
    "gap": gap,
    "held": held,
    "sparse": sparse_tracks,
}


@pytest.mark.parametrize("case", CASES)
def test_ends_where_gtsam_ends(case: str) -> None:
    problem = CASES[case]()
    ours, theirs = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert (ours.solver, theirs.solver) == ("schur", "gtsam")
    graph, _ = to_graph(problem)
    cost = [graph.error(to_graph(result.problem)[1]) for result in (ours, theirs)]
    assert cost[0] == pytest.approx(cost[1], rel=1e-8)
    assert sum(ours.report.cost_after.values()) == pytest.approx(cost[0], rel=1e-12)
    np.testing.assert_allclose(ours.problem.world_T_camera, theirs.problem.world_T_camera, rtol=0, atol=1e-6)
    assert ours.converged and not ours.stuck
    assert cost[0] < 0.25 * sum(ours.report.cost_before.values())


def test_finds_the_true_drive() -> None:
    problem, poses = drive()
    result = solve(problem).problem
    assert np.max(np.abs(result.world_T_camera[:, :3, 3] - poses[:, :3, 3])) < 0.06
    assert np.max(np.abs(problem.world_T_camera[:, :3, 3] - poses[:, :3, 3])) > 0.2


def test_held_frames_stay_to_the_last_bit() -> None:
    problem = held()
    for solver in ("schur", "gtsam"):
        result = solve(problem, TIGHT, solver).problem
        np.testing.assert_array_equal(
            result.world_T_camera[problem.fixed], problem.world_T_camera[problem.fixed]
        )
        assert not np.allclose(result.world_T_camera[~problem.fixed], problem.world_T_camera[~problem.fixed])


def test_all_frames_held_leaves_the_points_to_move() -> None:
    problem, poses = drive(frames=10, landmarks=40)
    problem = replace(problem, world_T_camera=poses, fixed=np.ones(10, dtype=bool))
    result = solve(problem, TIGHT)
    assert result.converged
    assert total(result.problem) < 0.1 * total(problem)


def test_landmarks_seen_once_or_never_do_no_harm() -> None:
    problem = one_view_each()
    assert np.any(views(problem) == 1)
    result = solve(problem, TIGHT)
    without = solve(only(problem, views(problem) > 1), TIGHT)
    assert result.converged
    np.testing.assert_allclose(result.problem.world_T_camera, without.problem.world_T_camera, atol=1e-6)
    unseen = np.setdiff1d(np.arange(300), problem.landmark)
    assert len(unseen)
    np.testing.assert_array_equal(result.problem.world_p_landmark[unseen], problem.world_p_landmark[unseen])


def test_points_behind_the_camera_stay_and_the_rest_is_solved() -> None:
    problem, _ = drive()
    points = problem.world_p_landmark.copy()
    points[::40] = [0.0, 0.0, -80.0]
    problem = replace(problem, world_p_landmark=points)
    ours, theirs = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert total(ours.problem) == pytest.approx(total(theirs.problem), rel=1e-8)
    np.testing.assert_allclose(ours.problem.world_T_camera, theirs.problem.world_T_camera, atol=1e-6)
    np.testing.assert_allclose(ours.problem.world_p_landmark[::40], points[::40])


def test_reduced_matrix_is_the_schur_complement_of_gtsam() -> None:
    problem = robust(drive(frames=8, landmarks=60, outliers=0.1)[0], "huber")
    graph, values = to_graph(problem)
    landmarks = np.unique(problem.landmark)
    ordering = gtsam.Ordering()
    for key in [*map(L, landmarks.tolist()), *map(X, range(8))]:
        ordering.push_back(key)
    H, g = graph.linearize(values).hessian(ordering)
    n = 3 * len(landmarks)
    coupling = np.linalg.solve(H[:n, :n], H[:n, n:])
    expected, expected_gradient = H[n:, n:] - H[n:, :n] @ coupling, -(g[n:] - coupling.T @ g[:n])

    structure = analyze_sparsity(problem)
    band, gradient = reduce_to_poses(linearize(problem, values, structure), structure, 0.0)
    rows, columns = np.tril_indices(48)
    inside = rows - columns <= structure.half_bandwidth
    rows, columns = rows[inside], columns[inside]
    scale = np.sqrt(np.diag(expected))
    difference = (band.ab[rows - columns, columns] - expected[rows, columns]) / scale[rows] / scale[columns]
    np.testing.assert_allclose(difference, 0.0, atol=1e-9)
    np.testing.assert_allclose(gradient / scale, expected_gradient / scale, atol=1e-7)


def test_gradient_is_that_of_the_cost_along_gtsams_chart() -> None:
    problem = robust(drive(frames=8, landmarks=60, outliers=0.1)[0], "cauchy")
    structure = analyze_sparsity(problem)
    linear = linearize(problem, all_pose_values(problem), structure)
    rng = np.random.default_rng(1)
    for _ in range(5):
        pose_step, point_step = rng.normal(size=(8, 6)), rng.normal(size=(60, 3))

        def cost(
            share: float, pose_step: np.ndarray = pose_step, point_step: np.ndarray = point_step
        ) -> float:
            steps = zip(problem.world_T_camera, share * pose_step, strict=True)
            poses = np.stack([gtsam.Pose3(T).retract(d).matrix() for T, d in steps])
            return total(problem.moved(poses, problem.world_p_landmark + share * point_step))

        slope = linear.gradient @ pose_step.ravel()
        for part in linear.chunks:
            slope += np.sum(part.gradient * point_step[part.chunk.landmarks].T)
        assert slope == pytest.approx((cost(1e-6) - cost(-1e-6)) / 2e-6, rel=1e-5)


@pytest.mark.parametrize("case", ["plain", "huber", "gap", "sparse"])
def test_covariances_are_gtsams_marginals(case: str) -> None:
    problem = solve(CASES[case](), TIGHT).problem
    marginals = gtsam.Marginals(*to_graph(problem))
    expected = np.stack([marginals.marginalCovariance(X(i)) for i in range(40)])
    found = marginal_covariances(problem).poses
    size = np.sqrt(np.einsum("fii->fi", expected))
    np.testing.assert_allclose((found - expected) / size[:, :, None] / size[:, None, :], 0.0, atol=1e-6)


def test_held_frames_have_no_covariance_and_the_others_that_of_the_rest() -> None:
    problem = held()
    covariance = marginal_covariances(problem).poses
    assert not np.any(covariance[problem.fixed])
    graph, values = to_graph(replace(problem, fixed=None))
    tight = gtsam.noiseModel.Isotropic.Sigma(6, 1e-6)
    for i in np.flatnonzero(problem.fixed).tolist():
        graph.addPriorPose3(X(i), values.atPose3(X(i)), tight)
    expected = gtsam.Marginals(graph, values).marginalCovariance(X(20))
    np.testing.assert_allclose(covariance[20], expected, rtol=1e-4, atol=1e-4 * np.max(expected))


def test_covariance_of_a_free_floating_run_is_refused() -> None:
    problem, _ = drive(frames=10, landmarks=80)
    with pytest.raises(GeometryError, match=r"frame \d+: its pose is not determined"):
        marginal_covariances(replace(problem, pose_graph=gtsam.NonlinearFactorGraph()))


def test_free_floating_run_is_still_solved() -> None:
    problem, _ = drive(frames=10, landmarks=80)
    problem = replace(problem, pose_graph=gtsam.NonlinearFactorGraph())
    result = solve(problem, TIGHT)
    assert result.converged
    assert total(result.problem) < 0.01 * total(problem)


@pytest.mark.parametrize("solver", ["schur", "gtsam"])
@pytest.mark.parametrize("seed", range(4))
def test_never_worse_than_the_start(solver: str, seed: int) -> None:
    problem, _ = drive(frames=12, landmarks=80, seed=seed, outliers=0.3, disturbed=30.0)
    result = solve(problem, SolverSettings(max_iterations=15), solver)
    assert total(result.problem) <= total(problem)
    assert sum(result.report.cost_after.values()) == pytest.approx(total(result.problem))


@pytest.mark.parametrize("solver", ["schur", "gtsam"])
def test_from_the_minimum_it_says_so(solver: str) -> None:
    best = solve(drive()[0], TIGHT, "gtsam").problem
    again = solve(best, solver=solver)
    assert again.converged and not again.stuck
    assert "converged" in again.report.stop_reason
    assert total(again.problem) <= total(best)


def lying_factor() -> gtsam.NonlinearFactorGraph:
    """A factor whose Jacobian points uphill: no step that trusts it lowers the cost."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: list | None) -> np.ndarray:
        if jacobians is not None:
            jacobians[0] = np.asfortranarray(np.hstack([np.zeros((3, 3)), -np.eye(3)]))
        return values.atPose3(this.keys()[0]).translation() - 10.0

    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(3), [X(0)], error))
    return graph


@pytest.mark.parametrize("solver", ["schur", "gtsam"])
def test_no_step_at_all_is_said_aloud(solver: str) -> None:
    problem, _ = drive(frames=10, landmarks=40)
    problem = replace(only(problem, np.zeros(len(problem.frame), dtype=bool)), pose_graph=lying_factor())
    result = solve(problem, solver=solver)
    assert result.stuck and not result.converged
    assert result.report.iterations == 0
    assert "no step lowers the cost" in result.report.stop_reason
    np.testing.assert_array_equal(result.problem.world_T_camera, problem.world_T_camera)


def test_stops_after_the_iterations_allowed() -> None:
    result = solve(drive()[0], SolverSettings(max_iterations=1))
    assert result.report.iterations == 1
    assert not result.converged and not result.stuck
    assert "1 iteration" in result.report.stop_reason


def test_start_without_a_finite_cost_is_refused() -> None:
    problem, _ = drive(frames=10, landmarks=20)
    points = problem.world_p_landmark.copy()
    points[problem.landmark[0]] = np.nan
    with pytest.raises(GeometryError, match="not finite"):
        solve(replace(problem, world_p_landmark=points))


def test_two_observations_in_one_frame_are_refused() -> None:
    problem, _ = drive(frames=10, landmarks=20)
    twice = only(problem, np.append(np.arange(len(problem.frame)), 3))
    with pytest.raises(ValueError, match="observed twice in one frame"):
        solve(twice)


def test_too_wide_a_band_goes_to_gtsam() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    narrow = replace(TIGHT, max_flops=1e3)
    assert solve(problem, narrow).solver == "gtsam"
    assert solve(problem, replace(TIGHT, max_bytes=1e3)).solver == "gtsam"
    assert total(solve(problem, narrow).problem) == pytest.approx(
        total(solve(problem, TIGHT).problem), rel=1e-8
    )


def test_poses_alone() -> None:
    """No observation anywhere: the pose factors decide, as GTSAM would have it."""
    problem, _ = drive(frames=10, landmarks=20)
    problem = only(problem, np.zeros(len(problem.frame), dtype=bool))
    ours, theirs = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    np.testing.assert_allclose(ours.problem.world_T_camera, theirs.problem.world_T_camera, atol=1e-6)
    assert ours.converged


def test_frame_that_nothing_mentions_stays() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    rng = np.random.default_rng(0)
    problem = replace(only(problem, problem.frame < 11), pose_graph=pose_factors(true_poses(12)[:11], rng))
    result = solve(problem, TIGHT)
    assert result.converged
    np.testing.assert_allclose(result.problem.world_T_camera[11], problem.world_T_camera[11], atol=1e-12)

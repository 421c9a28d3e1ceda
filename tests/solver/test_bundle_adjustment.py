from dataclasses import replace

import gtsam
import numpy as np
import pytest
from synthetic_bundle import (
    TIGHT,
    drive,
    held_frames,
    interrupted_tracks,
    keep_observations,
    pose_factors,
    sparse_tracks,
    total_cost,
    true_poses,
    views,
    with_loss,
    wrong_sign_factor,
)
from synthetic_states import drive_with_states

from vgps.errors import GeometryError
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.cost import cost_terms
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.problem import BundleProblem


def one_view_each() -> BundleProblem:
    """Return a drive some of whose landmarks are observed once, and so do not constrain the poses."""
    problem, _ = drive()
    _, first = np.unique(problem.landmark, return_index=True)
    is_first = np.isin(np.arange(len(problem.frame)), first)
    return keep_observations(problem, is_first | (problem.landmark % 5 != 0))


CASES = {
    "plain": lambda: drive()[0],
    "huber": lambda: with_loss(drive(outliers=0.05)[0], "huber"),
    "cauchy": lambda: with_loss(drive(outliers=0.05, disturbed=0.3)[0], "cauchy"),
    "gap": interrupted_tracks,
    "held": held_frames,
    "sparse": sparse_tracks,
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_minimum_is_that_of_gtsam(case: str) -> None:
    problem = CASES[case]()
    result, reference = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert (result.solver, reference.solver) == ("schur", "gtsam")
    graph, _ = to_graph(problem)
    cost = [graph.error(to_graph(end.problem)[1]) for end in (result, reference)]
    assert cost[0] == pytest.approx(cost[1], rel=1e-8)
    assert sum(result.report.cost_after.values()) == pytest.approx(cost[0], rel=1e-12)
    assert result.report.cost_before == pytest.approx(cost_terms(problem), rel=1e-12)
    assert result.report.cost_after == pytest.approx(cost_terms(result.problem), rel=1e-9)
    np.testing.assert_allclose(
        result.problem.world_T_camera, reference.problem.world_T_camera, rtol=0, atol=1e-6
    )
    assert result.converged and not result.stuck
    assert cost[0] < 0.25 * sum(result.report.cost_before.values())


def test_true_poses_are_recovered() -> None:
    problem, poses = drive()
    result = solve(problem).problem
    assert np.max(np.abs(result.world_T_camera[:, :3, 3] - poses[:, :3, 3])) < 0.06
    assert np.max(np.abs(problem.world_T_camera[:, :3, 3] - poses[:, :3, 3])) > 0.2


@pytest.mark.slow
def test_held_poses_stay_to_the_last_bit() -> None:
    problem = held_frames()
    for solver in ("schur", "gtsam"):
        result = solve(problem, TIGHT, solver).problem
        np.testing.assert_array_equal(
            result.world_T_camera[problem.fixed], problem.world_T_camera[problem.fixed]
        )
        assert not np.allclose(result.world_T_camera[~problem.fixed], problem.world_T_camera[~problem.fixed])


def test_landmarks_are_solved_with_all_poses_held() -> None:
    problem, poses = drive(frames=10, landmarks=40)
    problem = replace(problem, world_T_camera=poses, fixed=np.ones(10, dtype=bool))
    result = solve(problem, TIGHT)
    assert result.converged
    assert total_cost(result.problem) < 0.1 * total_cost(problem)


@pytest.mark.slow
def test_landmarks_observed_once_or_never_do_not_matter() -> None:
    problem = one_view_each()
    assert np.any(views(problem) == 1)
    result = solve(problem, TIGHT)
    without = solve(keep_observations(problem, views(problem) > 1), TIGHT)
    assert result.converged
    np.testing.assert_allclose(result.problem.world_T_camera, without.problem.world_T_camera, atol=1e-6)
    unseen = np.setdiff1d(np.arange(300), problem.landmark)
    assert len(unseen)
    np.testing.assert_array_equal(result.problem.world_p_landmark[unseen], problem.world_p_landmark[unseen])


@pytest.mark.slow
def test_landmarks_behind_the_camera_stay_and_the_rest_is_solved() -> None:
    problem, _ = drive()
    points = problem.world_p_landmark.copy()
    points[::40] = [0.0, 0.0, -80.0]
    problem = replace(problem, world_p_landmark=points)
    result, reference = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert total_cost(result.problem) == pytest.approx(total_cost(reference.problem), rel=1e-8)
    np.testing.assert_allclose(result.problem.world_T_camera, reference.problem.world_T_camera, atol=1e-6)
    np.testing.assert_allclose(result.problem.world_p_landmark[::40], points[::40])


def test_problem_without_fixes_is_solved() -> None:
    problem, _ = drive(frames=10, landmarks=80)
    problem = replace(problem, pose_graph=gtsam.NonlinearFactorGraph())
    result = solve(problem, TIGHT)
    assert result.converged
    assert total_cost(result.problem) < 0.01 * total_cost(problem)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["schur", "gtsam"])
@pytest.mark.parametrize("seed", range(4))
def test_cost_never_rises(solver: str, seed: int) -> None:
    problem, _ = drive(frames=12, landmarks=80, seed=seed, outliers=0.3, disturbed=30.0)
    result = solve(problem, SolverSettings(max_iterations=15), solver)
    assert total_cost(result.problem) <= total_cost(problem)
    assert sum(result.report.cost_after.values()) == pytest.approx(total_cost(result.problem))


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["schur", "gtsam"])
def test_minimum_is_recognised(solver: str) -> None:
    best = solve(drive()[0], TIGHT, "gtsam").problem
    again = solve(best, solver=solver)
    assert again.converged and not again.stuck
    assert "converged" in again.report.stop_reason
    assert total_cost(again.problem) <= total_cost(best)


@pytest.mark.parametrize("solver", ["schur", "gtsam"])
def test_no_step_is_reported_as_stuck(solver: str) -> None:
    problem, _ = drive(frames=10, landmarks=40)
    problem = replace(
        keep_observations(problem, np.zeros(len(problem.frame), dtype=bool)), pose_graph=wrong_sign_factor()
    )
    result = solve(problem, solver=solver)
    assert result.stuck and not result.converged
    assert result.report.iterations == 0
    assert "no step lowers the cost" in result.report.stop_reason
    np.testing.assert_array_equal(result.problem.world_T_camera, problem.world_T_camera)


def test_maximum_of_iterations() -> None:
    result = solve(drive()[0], SolverSettings(max_iterations=1))
    assert result.report.iterations == 1
    assert not result.converged and not result.stuck
    assert "1 iteration" in result.report.stop_reason


def test_start_of_infinite_cost_is_refused() -> None:
    problem, _ = drive(frames=10, landmarks=20)
    points = problem.world_p_landmark.copy()
    points[problem.landmark[0]] = np.nan
    with pytest.raises(GeometryError, match="not finite"):
        solve(replace(problem, world_p_landmark=points))


def test_landmark_observed_twice_in_one_frame_is_refused() -> None:
    problem, _ = drive(frames=10, landmarks=20)
    twice = keep_observations(problem, np.append(np.arange(len(problem.frame)), 3))
    with pytest.raises(ValueError, match="observed twice in one frame"):
        solve(twice)


@pytest.mark.slow
def test_problem_beyond_the_limits_goes_to_gtsam() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    narrow = replace(TIGHT, max_flops=1e3)
    assert solve(problem, narrow).solver == "gtsam"
    assert solve(problem, replace(TIGHT, max_bytes=1e3)).solver == "gtsam"
    assert total_cost(solve(problem, narrow).problem) == pytest.approx(
        total_cost(solve(problem, TIGHT).problem), rel=1e-8
    )


def test_problem_without_observations() -> None:
    """Without observations the pose factors alone determine the poses."""
    problem, _ = drive(frames=10, landmarks=20)
    problem = keep_observations(problem, np.zeros(len(problem.frame), dtype=bool))
    result, reference = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    np.testing.assert_allclose(result.problem.world_T_camera, reference.problem.world_T_camera, atol=1e-6)
    assert result.converged


def test_frame_without_observations_and_factors_stays() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    rng = np.random.default_rng(0)
    problem = replace(
        keep_observations(problem, problem.frame < 11), pose_graph=pose_factors(true_poses(12)[:11], rng)
    )
    result = solve(problem, TIGHT)
    assert result.converged
    np.testing.assert_allclose(result.problem.world_T_camera[11], problem.world_T_camera[11], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_states_are_moved_to_the_minimum_of_gtsam(held: bool) -> None:
    problem = drive_with_states(held)
    result, reference = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert result.solver == "schur" and result.converged
    assert total_cost(result.problem) == pytest.approx(total_cost(reference.problem), rel=1e-9)
    assert total_cost(result.problem) < 0.5 * total_cost(problem)
    for key, state in result.problem.states.items():
        np.testing.assert_allclose(state.vector, reference.problem.states[key].vector, atol=1e-6)
        assert state.frame == problem.states[key].frame and np.any(state.vector)
    poses = result.problem.world_T_camera
    np.testing.assert_allclose(poses, reference.problem.world_T_camera, atol=1e-6)
    np.testing.assert_array_equal(poses[problem.fixed_frames], problem.world_T_camera[problem.fixed_frames])


@pytest.mark.slow
@pytest.mark.parametrize("case", ["huber", "held"])
def test_the_result_does_not_depend_on_the_number_of_threads(case, monkeypatch):
    monkeypatch.setattr("vgps.solver.equations.chunks.CHUNK_OBSERVATIONS", 100)
    ends = []
    for threads in (1, 3):
        monkeypatch.setattr("vgps.runtime.threads.usable_cores", lambda threads=threads: threads)
        ends.append(solve(CASES[case](), SolverSettings(max_iterations=3)))
    one, three = (end.problem for end in ends)
    np.testing.assert_array_equal(one.world_T_camera, three.world_T_camera)
    np.testing.assert_array_equal(one.world_p_landmark, three.world_p_landmark)
    assert ends[0].report == ends[1].report

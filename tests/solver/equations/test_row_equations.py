"""The engine with a rolling shutter against GTSAM with the factors of ``factors/rolling_shutter.py``."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L
from gtsam_steps import check_first_step
from synthetic_bundle import TIGHT, held_frames, total_cost, with_loss
from synthetic_rows import path_error, rolling_drive

from vgps.solver.bundle_adjustment import solve
from vgps.solver.equations import chunks
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.equations.schur_complement import reduce_to_poses
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem
from vgps.solver.row_times import RowTimes


def small(held: bool = False) -> BundleProblem:
    problem, _ = rolling_drive(frames=9, landmarks=70, outliers=0.1)
    problem = with_loss(problem, "huber")
    if held:
        problem = replace(problem, fixed=np.isin(np.arange(9), [0, 1, 5]))
    return problem


def gtsam_system(problem: BundleProblem) -> tuple[np.ndarray, np.ndarray]:
    """Return GTSAM's Hessian and gradient of free poses, landmarks eliminated."""
    graph, values = to_graph(replace(problem, fixed=None))
    landmarks = np.unique(problem.landmark)
    free = problem.keys[~problem.fixed_frames].tolist()
    ordering = gtsam.Ordering()
    for key in [*map(L, landmarks.tolist()), *free, *problem.keys[problem.fixed_frames]]:
        ordering.push_back(key)
    H, g = graph.linearize(values).hessian(ordering)
    n, size = 3 * len(landmarks), 3 * len(landmarks) + 6 * len(free)
    coupling = np.linalg.solve(H[:n, :n], H[:n, n:size])
    return H[n:size, n:size] - H[n:size, :n] @ coupling, -(g[n:size] - coupling.T @ g[:n])


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_the_reduced_system_equals_that_of_gtsam(held: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "CHUNK_OBSERVATIONS", 60)
    problem = small(held)
    H, g = gtsam_system(problem)
    structure = analyse_sparsity(problem)
    assert max(chunk.first_frame for chunk in structure.chunks) > 0
    linear = linearise(problem, all_pose_values(problem), structure)
    matrix, gradient = reduce_to_poses(linear, structure, 0.0)
    found = np.zeros_like(H)
    rows, columns = np.tril_indices(len(gradient))
    inside = rows - columns <= structure.half_bandwidth
    rows, columns = rows[inside], columns[inside]
    found[rows, columns] = found[columns, rows] = matrix.ab[rows - columns, columns]
    scale = np.sqrt(np.diag(H))
    np.testing.assert_allclose(found / scale / scale[:, None], H / scale / scale[:, None], atol=1e-8)
    np.testing.assert_allclose(gradient / scale, g / scale, atol=1e-6)


@pytest.mark.slow
def test_landmarks_follow_the_poses() -> None:
    check_first_step(small())


@pytest.mark.slow
def test_the_cost_is_that_of_the_graph() -> None:
    problem = small()
    graph, values = to_graph(problem)
    assert total_cost(problem) == pytest.approx(graph.error(values), rel=1e-10)


@pytest.mark.slow
def test_the_engine_and_gtsam_end_at_one_minimum() -> None:
    problem = with_loss(rolling_drive(frames=12, landmarks=70)[0], "huber")
    ours, gtsams = (solve(problem, TIGHT, solver) for solver in ("schur", "gtsam"))
    assert ours.solver == "schur" and ours.converged
    assert total_cost(ours.problem) == pytest.approx(total_cost(gtsams.problem), rel=1e-7)
    np.testing.assert_allclose(ours.problem.world_T_camera, gtsams.problem.world_T_camera, atol=2e-4)


@pytest.mark.slow
def test_poses_are_recovered_where_a_global_shutter_fails() -> None:
    problem, truth = rolling_drive(noise_px=0.0)
    tied = replace(problem, fixed=np.isin(np.arange(40), [0, 1, 20, 39]))
    start = problem.world_T_camera.copy()
    start[tied.fixed_frames] = truth[tied.fixed_frames]
    tied = replace(tied, world_T_camera=start, pose_graph=gtsam.NonlinearFactorGraph())
    known = solve(tied, TIGHT).problem
    assert path_error(known.world_T_camera, truth) < 1e-6
    rigid = solve(replace(tied, row_times=None), TIGHT).problem
    assert path_error(rigid.world_T_camera, truth) > 0.005


@pytest.mark.slow
def test_no_readout_is_a_global_shutter() -> None:
    problem, _ = rolling_drive()
    assert problem.row_times is not None
    still = replace(problem, row_times=replace(problem.row_times, readout_s=0.0))
    rigid = replace(problem, row_times=None)
    assert total_cost(still) == pytest.approx(total_cost(rigid), rel=1e-12)
    ends = [solve(p, TIGHT).problem for p in (still, rigid)]
    np.testing.assert_allclose(ends[0].world_T_camera, ends[1].world_T_camera, atol=1e-6)


def test_the_knots_lie_around_the_rows_time() -> None:
    t_s, frame = np.arange(8) / 10, np.array([3, 3, 0, 7, 1])
    share = np.array([-0.4, 0.4, -0.5, 0.5, 0.0])
    times = RowTimes.of_frames(t_s, frame, share, 0.05)
    np.testing.assert_array_equal(times.knots[:, 0], [1, 2, 0, 4, 0])
    np.testing.assert_array_equal(RowTimes.of_frames(t_s, frame, share, -0.05).knots[:2, 0], [2, 1])
    np.testing.assert_allclose(times.weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(times.weights @ np.ones(4), times.matrix.sum(axis=1))
    ahead, behind = (replace(times, readout_s=0.05 + d).weights for d in (1e-6, -1e-6))
    by_readout = times.by_readout.toarray()[np.arange(5)[:, None], times.knots - times.first]
    np.testing.assert_allclose(by_readout, (ahead - behind) / 2e-6, atol=1e-6)


@pytest.mark.slow
def test_held_frames_stay() -> None:
    problem = held_frames()
    times = RowTimes.of_frames(np.arange(40) / 10, problem.frame, problem.uv_px[:, 1] / 480 - 0.5, 0.03)
    end = solve(replace(problem, row_times=times), TIGHT)
    assert end.converged
    np.testing.assert_array_equal(end.problem.world_T_camera[:12], problem.world_T_camera[:12])

"""The simulated problem along a path that revisits places."""

import numpy as np
import pytest

from scripts.benchmarks.bundle import round_the_block
from scripts.common.revisited_path import CAMERA, ProblemSize, choose_keyframes, simulate_problem
from vgps.solver.bundle_adjustment import solve
from vgps.solver.cost import reprojection_errors

LAPS = round_the_block(400, 2)
SIZE = ProblemSize(frames=120, landmarks=600, observations=3000)


def test_keyframes_are_close_in_turns_and_none_is_chosen_twice():
    yaw = np.radians(np.clip(np.arange(100) - 50, 0, 20) * 4.5)  # a quarter on the spot, in the middle
    poses = np.tile(np.eye(4), (100, 1, 1))
    poses[:, 0, 0] = poses[:, 2, 2] = np.cos(yaw)
    poses[:, 0, 2], poses[:, 2, 0] = np.sin(yaw), -np.sin(yaw)
    poses[:, 2, 3] = np.clip(np.arange(100), 0, 50) + np.clip(np.arange(100) - 70, 0, 29)
    kept = choose_keyframes(poses, 40)
    assert len(np.unique(kept.reshape(40, -1), axis=0)) == 40
    assert (kept[:, 2, 3] == 50.0).sum() == pytest.approx(40 * 27 / (79 + 27), abs=1.0)  # 90 deg as 27 m
    np.testing.assert_array_equal(choose_keyframes(poses, 100), poses)


@pytest.mark.slow
def test_a_problem_has_its_size_loops_and_the_minimum_of_its_noise():
    problem, priors = simulate_problem(LAPS, SIZE)
    count = np.bincount(problem.landmark)
    assert (len(problem.world_T_camera), len(count), count.sum()) == (120, 600, 3000) and count.min() >= 2
    span = np.zeros(600, int)
    np.maximum.at(span, problem.landmark, problem.frame)
    np.minimum.at(first := np.full(600, 120), problem.landmark, problem.frame)
    assert 0.1 < np.mean(span - first > 50) < 0.7  # landmarks that the second lap observes again
    assert np.all((problem.uv_px > -3.0) & (problem.uv_px < (CAMERA.width + 3.0, CAMERA.height + 3.0)))
    end = solve(problem).report.cost_after
    unknowns = 6 * 120 + 3 * 600
    expected = 0.5 * (2 * 3000 + 3 * len(priors.frame) - unknowns)  # chi squared's mean
    assert sum(end.values()) == pytest.approx(expected, rel=0.1)


def test_more_observations_than_views_are_refused():
    with pytest.raises(ValueError, match="found, expected 1000000"):
        simulate_problem(LAPS, ProblemSize(120, 600, 1_000_000))


def test_colmap_gets_the_same_problem():
    peer = pytest.importorskip("scripts.common.colmap_peer", reason="needs pycolmap")
    problem, _ = simulate_problem(LAPS, SIZE)
    model = peer.as_reconstruction(problem, CAMERA)
    assert model.num_points3D() == 600 and model.compute_num_observations() == 3000
    same = peer.solved(problem.moved(np.zeros((120, 4, 4)), np.zeros((600, 3))), model)
    np.testing.assert_allclose(same.world_p_landmark, problem.world_p_landmark)
    np.testing.assert_allclose(same.world_T_camera[:, :3], problem.world_T_camera[:, :3], atol=1e-9)
    error_px = np.linalg.norm(reprojection_errors(problem)[0], axis=1)
    model.update_point_3d_errors()
    by_point = np.bincount(problem.landmark, error_px) / np.bincount(problem.landmark)
    np.testing.assert_allclose([model.point3D(j + 1).error for j in range(600)], by_point)

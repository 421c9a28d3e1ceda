from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import drive
from synthetic_rows import rolling_drive

from vgps.geometry import triangulate
from vgps.solver import landmark_refinement
from vgps.solver.bundle_adjustment import solve
from vgps.solver.cost import camera_points, pixel_errors, video_cost
from vgps.solver.equations import chunks
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.landmark_refinement import (
    anchor_frames,
    landmark_costs,
    move_with_frames,
    refine_landmarks,
    step_landmarks,
)

MATRIX = np.array([[500.0, 0.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]])


def test_costs_of_landmarks_add_up_to_that_of_the_video():
    problem, _ = drive(20, 200, seed=1, disturbed=0.3)
    (costs,) = landmark_costs(problem, analyse_sparsity(problem), problem.world_p_landmark)
    assert costs.sum() == pytest.approx(video_cost(problem), rel=1e-12)
    one = int(problem.landmark[0])
    rows = problem.landmark == one
    error, _ = pixel_errors(problem, camera_points(problem))
    own = 0.5 * np.sum(error[:, rows] ** 2, axis=0) / problem.sigma_px[rows] ** 2
    if problem.robust == "none":
        assert costs[one] == pytest.approx(own.sum(), rel=1e-12)


def test_points_keep_their_place_in_the_camera_frame():
    problem, poses = drive(20, 200, seed=1)
    anchor = anchor_frames(problem)
    assert all(anchor[i] == problem.frame[problem.landmark == i].max() for i in np.unique(problem.landmark))
    after = poses.copy()
    after[:, :3, 3] += np.random.default_rng(0).normal(0.0, 1.0, (20, 3))
    after[:, :3, :3] = after[:, :3, :3] @ poses[7, :3, :3]
    points = problem.world_p_landmark
    moved = move_with_frames(points, poses, after, anchor, 2.0)
    for i in (0, 5, 17):
        before_camera = poses[anchor[i], :3, :3].T @ (points[i] - poses[anchor[i], :3, 3])
        after_camera = after[anchor[i], :3, :3].T @ (moved[i] - after[anchor[i], :3, 3])
        np.testing.assert_allclose(after_camera, 2.0 * before_camera, atol=1e-12)


def test_landmark_is_refined_to_its_triangulation_and_the_others_stay():
    problem, _ = drive(20, 200, seed=1)
    problem = replace(problem, robust="none", robust_k=None, sigma_px=np.ones(len(problem.frame)))
    seen = np.bincount(problem.landmark, minlength=200)
    one = int(seen.argmax())
    away = problem.world_p_landmark.copy()
    away += np.random.default_rng(0).normal(0.0, 0.5, away.shape)
    which = np.arange(len(away)) == one
    start = replace(problem, world_p_landmark=away)
    structure = analyse_sparsity(problem)
    nearer, gain = refine_landmarks(start, which, structure)
    found, _ = refine_landmarks(replace(start, world_p_landmark=nearer), which, structure)
    rows = problem.landmark == one
    views = problem.world_T_camera[problem.frame[rows]]
    best, _ = triangulate(MATRIX, views, problem.uv_px[rows], np.array([0]), iterations=10)
    assert gain > 0.0
    np.testing.assert_allclose(found[one], best[0], atol=1e-4)
    np.testing.assert_array_equal(found[~which], away[~which])


def test_cost_of_a_refined_landmark_never_rises():
    problem, _ = drive(20, 200, seed=2, disturbed=1.0)
    away = problem.world_p_landmark + np.random.default_rng(0).normal(
        0.0, 30.0, problem.world_p_landmark.shape
    )
    start = replace(problem, world_p_landmark=away)
    structure = analyse_sparsity(problem)
    found, gain = refine_landmarks(start, np.ones(len(away), dtype=bool), structure)
    before, after = landmark_costs(start, structure, start.world_p_landmark, found)
    assert (after <= before + 1e-9).all() and after.sum() < 0.8 * before.sum()
    assert gain == pytest.approx(before.sum() - after.sum(), rel=1e-9)


@pytest.mark.parametrize("made", [drive(20, 200, seed=2)[0], rolling_drive()[0]], ids=["global", "rolling"])
def test_many_landmarks_are_refined_chunk_by_chunk_as_all_at_once(monkeypatch, made):
    away = made.world_p_landmark + np.random.default_rng(0).normal(0.0, 3.0, made.world_p_landmark.shape)
    start, which = replace(made, world_p_landmark=away), np.arange(len(away)) % 3 > 0
    at_once = refine_landmarks(start, which, analyse_sparsity(made))
    monkeypatch.setattr(chunks, "CHUNK_OBSERVATIONS", 100)
    monkeypatch.setattr(landmark_refinement, "CHUNK_OBSERVATIONS", 100)
    structure = analyse_sparsity(made)
    assert len(structure.chunks) > 3
    first = refine_landmarks(start, which, replace(structure, chunks=structure.chunks[:1]))[0]
    moved, there = np.any(first != away, axis=1), np.isin(np.arange(len(away)), structure.chunks[0].landmarks)
    assert moved.any() and not moved[~there].any()
    by_chunk = refine_landmarks(start, which, structure)
    np.testing.assert_allclose(by_chunk[0], at_once[0], rtol=1e-9)
    assert by_chunk[1] == pytest.approx(at_once[1], rel=1e-9) and at_once[1] > 0.0
    assert (by_chunk[0][~which] == away[~which]).all()


@pytest.mark.slow
def test_a_few_bad_landmarks_do_not_hold_back_the_poses():
    """Landmarks a hundred times too far along their rays: the linear model of their depth is useless."""
    problem, _ = drive(40, 400, seed=3, disturbed=0.5)
    bad = np.arange(0, 400, 20)
    away = problem.world_p_landmark.copy()
    eye = problem.world_T_camera[anchor_frames(problem)[bad], :3, 3]
    away[bad] = eye + 100.0 * (away[bad] - eye)
    clean, spoilt = solve(problem), solve(replace(problem, world_p_landmark=away))
    moved = spoilt.problem.world_T_camera[:, :3, 3] - clean.problem.world_T_camera[:, :3, 3]
    assert np.linalg.norm(moved, axis=1).max() < 1e-3
    assert spoilt.report.iterations <= 5 * clean.report.iterations


def test_bad_steps_are_replaced_by_the_motion_of_the_frames():
    problem, poses = drive(20, 200, seed=1)
    after = poses.copy()
    after[:, :3, 3] += [3.0, 0.0, 0.0]
    before = replace(problem, world_T_camera=poses)
    moved, structure = replace(problem, world_T_camera=after), analyse_sparsity(problem)
    wild = np.random.default_rng(0).normal(0.0, 50.0, problem.world_p_landmark.shape)
    points, cost = step_landmarks(moved, before, anchor_frames(problem), wild, structure)
    assert cost == pytest.approx(video_cost(replace(moved, world_p_landmark=points)), rel=1e-9)
    assert cost < landmark_costs(before, structure, before.world_p_landmark)[0].sum() + 1e-9
    right = np.tile([3.0, 0.0, 0.0], (200, 1))
    points, cost = step_landmarks(moved, before, anchor_frames(problem), right, structure)
    assert cost <= landmark_costs(before, structure, before.world_p_landmark)[0].sum() + 1e-9

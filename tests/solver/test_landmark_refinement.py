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
    inverse_distance_step,
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
    nearer, gain = refine_landmarks(start, which, structure, start.world_p_landmark)
    found, _ = refine_landmarks(replace(start, world_p_landmark=nearer), which, structure, nearer)
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
    found, gain = refine_landmarks(start, np.ones(len(away), dtype=bool), structure, away)
    before, after = landmark_costs(start, structure, start.world_p_landmark, found)
    assert (after <= before + 1e-9).all() and after.sum() < 0.8 * before.sum()
    assert gain == pytest.approx(before.sum() - after.sum(), rel=1e-9)


def test_the_better_start_of_a_landmark_counts():
    problem, _ = drive(20, 200, seed=2)
    structure, every, seen = analyse_sparsity(problem), np.ones(200, dtype=bool), np.unique(problem.landmark)
    near, far = problem.world_p_landmark, problem.world_p_landmark + 1e4
    away = replace(problem, world_p_landmark=far)
    found, mended = (
        refine_landmarks(problem, every, structure, far),
        refine_landmarks(away, every, structure, near),
    )
    np.testing.assert_array_equal(found[0][seen], mended[0][seen])
    assert mended[1] > found[1] > 0.0


@pytest.mark.parametrize("made", [drive(20, 200, seed=2)[0], rolling_drive()[0]], ids=["global", "rolling"])
def test_many_landmarks_are_refined_chunk_by_chunk_as_all_at_once(monkeypatch, made):
    away = made.world_p_landmark + np.random.default_rng(0).normal(0.0, 3.0, made.world_p_landmark.shape)
    start, which = replace(made, world_p_landmark=away), np.arange(len(away)) % 3 > 0
    other = np.where(np.arange(len(away))[:, None] % 2 > 0, made.world_p_landmark, away)
    at_once = refine_landmarks(start, which, analyse_sparsity(made), other)
    monkeypatch.setattr(chunks, "CHUNK_OBSERVATIONS", 100)
    monkeypatch.setattr(landmark_refinement, "CHUNK_OBSERVATIONS", 100)
    structure = analyse_sparsity(made)
    assert len(structure.chunks) > 3
    first = refine_landmarks(start, which, replace(structure, chunks=structure.chunks[:1]), other)[0]
    moved, there = np.any(first != away, axis=1), np.isin(np.arange(len(away)), structure.chunks[0].landmarks)
    assert moved.any() and not moved[~there].any()
    by_chunk = refine_landmarks(start, which, structure, other)
    np.testing.assert_allclose(by_chunk[0], at_once[0], rtol=1e-9)
    assert by_chunk[1] == pytest.approx(at_once[1], rel=1e-9) and at_once[1] > 0.0
    assert (by_chunk[0][~which] == away[~which]).all()


@pytest.mark.slow
@pytest.mark.parametrize("farther", [0.1, 100.0, 1000.0])
def test_a_few_bad_landmarks_do_not_hold_back_the_poses(farther):
    """Landmarks much too near or too far along their rays: a linear model of their position is useless."""
    problem, _ = drive(40, 400, seed=3, disturbed=0.5)
    bad = np.arange(0, 400, 20)
    away = problem.world_p_landmark.copy()
    eye = problem.world_T_camera[anchor_frames(problem)[bad], :3, 3]
    away[bad] = eye + farther * (away[bad] - eye)
    clean, spoilt = solve(problem), solve(replace(problem, world_p_landmark=away))
    moved = spoilt.problem.world_T_camera[:, :3, 3] - clean.problem.world_T_camera[:, :3, 3]
    assert np.linalg.norm(moved, axis=1).max() < 1e-3
    assert spoilt.report.iterations <= clean.report.iterations + 3


@pytest.mark.parametrize(
    ("step", "after"),
    [
        ([0.0, 0.0, 5.0], [0.0, 0.0, 20.0]),  # half the inverse distance
        ([0.0, 0.0, -10.0], [0.0, 0.0, 5.0]),  # twice; the linear model leads into the camera
        ([0.0, 0.0, -90.0], [0.0, 0.0, 1.0]),  # ten times; it leads far behind it
        ([0.0, 0.0, 10.0], [0.0, 0.0, 100.0]),  # none at all: at most ten times as far
        ([0.0, 0.0, 1e6], [0.0, 0.0, 100.0]),
        ([10.0, 0.0, 0.0], [np.sqrt(50.0), 0.0, np.sqrt(50.0)]),  # another direction, as far as before
    ],
)
def test_steps_are_of_direction_and_inverse_distance(step, after):
    """Of a point ten metres ahead, from a frame that moves by (1, 2, 3) itself."""
    eye, moved = np.eye(4)[None], np.eye(4)[None]
    moved[0, :3, 3] = [1.0, 2.0, 3.0]
    points, relative = np.array([[0.0, 0.0, 10.0]]), np.array([step]) + moved[:, :3, 3]
    stepped = inverse_distance_step(points, relative, eye, moved, np.array([0]))
    np.testing.assert_allclose(stepped[0] - moved[0, :3, 3], after, atol=1e-12)


def test_short_steps_are_those_of_the_linear_model():
    rng = np.random.default_rng(0)
    problem, poses = drive(20, 200, seed=1)
    after = poses.copy()
    after[:, :3, 3] += 1e-4 * rng.normal(size=(20, 3))
    points, step = problem.world_p_landmark, 1e-4 * rng.normal(size=(200, 3))
    stepped = inverse_distance_step(points, step, poses, after, anchor_frames(problem))
    np.testing.assert_allclose(stepped, points + step, atol=1e-7)


def test_a_point_in_the_centre_of_its_frame_stays_finite():
    eye = np.eye(4)[None]
    stepped = inverse_distance_step(np.zeros((1, 3)), np.ones((1, 3)), eye, eye, np.array([0]))
    np.testing.assert_allclose(stepped, 0.0, atol=1e-12)


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

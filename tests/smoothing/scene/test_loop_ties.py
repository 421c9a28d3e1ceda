from dataclasses import replace

import gtsam
import numpy as np
from synthetic_bundle import K, true_poses
from synthetic_rows import rolling_drive

from vgps.geometry import project
from vgps.smoothing.scene.loop_ties import _jacobians, fitting_loops, loop_gradient
from vgps.solver.cost import cost_terms, reprojection_errors
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.problem import BundleProblem

FRAMES = 24


def problem_with_loop() -> tuple[BundleProblem, np.ndarray]:
    """Tracks of the first and of the last eight frames, and two late frames that observe early landmarks."""
    rng = np.random.default_rng(4)
    poses = true_poses(FRAMES)
    points = np.concatenate(
        [poses[k, :3, 3] + rng.uniform((-6, -3, 8), (6, 3, 16), (20, 3)) for k in (4, 20)]
    )
    matrix = np.array([[K[0], 0, K[2]], [0, K[1], K[3]], [0, 0, 1]])
    rows = [(frame, j) for frame in range(8) for j in range(20)]
    rows += [(frame, 20 + j) for frame in range(16, FRAMES) for j in range(20)]
    rows += [(frame, j) for frame in (8, 9) for j in range(20)]
    frame, landmark = np.array(rows).T
    uv = np.array([project(matrix, poses[i], points[j : j + 1])[0][0] for i, j in rows])
    made = BundleProblem(
        K=K,
        world_T_camera=poses,
        world_p_landmark=points,
        frame=frame,
        landmark=landmark,
        uv_px=uv,
        sigma_px=np.full(len(frame), 0.5),
    )
    return made, np.where(np.arange(len(rows)) < 320, -1, np.arange(len(rows)) % 20 % 2)


def test_the_gradient_is_that_of_the_cost_where_tracks_keep_their_residuals() -> None:
    problem, loop = problem_with_loop()
    structure = analyse_sparsity(problem)
    # a deformation that the first eight frames, and so their landmarks, take no part in
    rng = np.random.default_rng(1)
    drift = np.zeros((FRAMES, 6))
    drift[8:10] = 1e-6 * rng.normal(size=(2, 6))
    gradient = loop_gradient(problem, loop, structure, drift.reshape(-1, 1)).reshape(FRAMES, 6)
    # half of that step's squared change of residuals, with landmarks that give way
    poses = [gtsam.Pose3(T).retract(d).matrix() for T, d in zip(problem.world_T_camera, drift, strict=True)]
    held = cost_terms(replace(problem, world_T_camera=np.array(poses)))["video"]
    assert 0.0 < 0.5 * np.sum(drift * gradient) <= held * (1 + 1e-3)
    assert not gradient[10:16].any() and np.abs(gradient[:8]).max() > 0


def test_a_motion_of_everything_gives_no_gradient() -> None:
    problem, loop = problem_with_loop()
    structure = analyse_sparsity(problem)
    world = np.array([0.3, -0.2, 0.5])
    drift = np.zeros((FRAMES, 6))
    drift[:, 3:] = problem.world_T_camera[:, :3, :3].transpose(0, 2, 1) @ world
    whole = loop_gradient(problem, loop, structure, drift.reshape(-1, 1))
    drift[8:10] = 0.0
    part = loop_gradient(problem, loop, structure, drift.reshape(-1, 1))
    assert np.abs(whole).max() < 1e-6 * np.abs(part).max()


def test_loops_that_were_all_refused_give_no_gradient() -> None:
    problem, loop = problem_with_loop()
    drift = np.ones((6 * FRAMES, 1))
    assert not loop_gradient(problem, np.full_like(loop, -1), analyse_sparsity(problem), drift).any()


def test_a_loop_is_refused_as_a_whole() -> None:
    loop = np.array([-1, -1, 0, 0, 0, 1, 1])
    good = np.array([True, False, True, True, False, False, True])
    in_front = np.array([True, True, True, True, True, False, True])
    kept = fitting_loops(good, in_front, loop, rough=False)
    assert kept.tolist() == [True, False, True, True, False, False, True]
    good[2] = False
    assert fitting_loops(good, in_front, loop, False).tolist() == [True, *[False] * 5, True]
    # before the first optimisation their errors say nothing
    assert fitting_loops(good, in_front, loop, True).tolist() == [True, False, True, True, True, False, True]


def test_landmarks_move_observations_of_a_rolling_shutter_as_seen_from_their_rows() -> None:
    problem, _ = rolling_drive()
    _, found = _jacobians(problem)
    poses, points, step = problem.world_T_camera, problem.world_p_landmark, 1e-5
    for k, delta in enumerate(step * np.eye(3)):
        (ahead, _), (behind, _) = (
            reprojection_errors(problem.moved(poses, points + d)) for d in (delta, -delta)
        )
        expected = (ahead - behind) / (2 * step) / problem.sigma_px[:, None]
        np.testing.assert_allclose(found[:, :, k], expected, rtol=0, atol=1e-6 * np.abs(found).max())

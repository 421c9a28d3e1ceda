from dataclasses import replace

import gtsam
import numpy as np
from scipy.spatial.transform import Rotation
from synthetic_bundle import TIGHT, K, held_frames

from vgps.smoothing.stage_c.bending import bending_of, farthest_of_first_views
from vgps.solver.bundle_adjustment import solve
from vgps.solver.marginals import marginal_covariances
from vgps.solver.problem import BundleProblem

FRAMES, NOISE_PX = 20, 0.3
LOOKING_DOWN = [[1, 0, 0], [0, 0, 1], [0, -1, 0]] @ Rotation.from_euler("x", -35.0, degrees=True).as_matrix()


def climb(rng: np.random.Generator, relief_m: float) -> tuple[BundleProblem, np.ndarray]:
    """A camera rises from 2 to 5 m over ground with such a relief; the problem begins at the truth."""
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3], poses[:, 2, 3] = LOOKING_DOWN, np.linspace(2.0, 5.0, FRAMES)
    points = rng.uniform([-2.0, 2.0, 0.0], [2.0, 7.0, relief_m], (60, 3))
    seen = (points[None] - poses[:, None, :3, 3]) @ LOOKING_DOWN
    uv = seen[..., :2] / seen[..., 2:] * K[:2] + K[2:]
    frame, landmark = (index.ravel() for index in np.indices((FRAMES, 60)))
    problem = BundleProblem(
        K=K,
        world_T_camera=poses,
        world_p_landmark=points,
        frame=frame,
        landmark=landmark,
        uv_px=uv.reshape(-1, 2) + rng.normal(0.0, NOISE_PX, (len(frame), 2)),
        sigma_px=np.full(len(frame), NOISE_PX),
        pose_graph=gtsam.NonlinearFactorGraph(),
    )
    return problem, poses


def solved(relief_m: float, seed: int) -> tuple[float, float]:
    """Variance of the end across the path over its length, as drawn and as the bending says, rad^2."""
    problem, true = climb(np.random.default_rng(seed), relief_m)
    scale = farthest_of_first_views(true)
    problem = replace(problem, fixed=np.isin(np.arange(FRAMES), [0, scale]))
    result = solve(problem, TIGHT).problem
    off, length = result.world_T_camera[-1, :2, 3] - true[-1, :2, 3], true[-1, 2, 3] - true[scale, 2, 3]
    bending = bending_of(result)
    assert np.isnan(bending[: scale + 1]).all() and (bending[scale + 1 :] >= 0.0).all()
    return 0.5 * float(off @ off) / length**2, float(np.nansum(bending)) / 3.0


def test_the_path_of_a_climb_over_flat_ground_strays_as_its_bending_says():
    flat = np.mean([solved(0.0, seed) for seed in range(12)], axis=0)
    relief = np.mean([solved(1.5, seed) for seed in range(12)], axis=0)
    for drawn, stated in (flat, relief):
        assert 0.7 < np.sqrt(drawn / stated) < 1.5
    assert flat[1] > 2.0 * relief[1]


def test_the_bending_is_the_growth_of_the_rotations_variance_since_the_frame_that_is_held():
    problem = solve(held_frames(), TIGHT).problem
    problem = replace(problem, fixed=np.arange(40) < 12)
    covariance = marginal_covariances(problem).poses[:, :3, :3]
    variance = np.maximum.accumulate(np.trace(covariance, axis1=1, axis2=2)[12:] / 3.0)
    bending = bending_of(problem)
    assert np.isnan(bending[:12]).all()
    np.testing.assert_allclose(np.cumsum(bending[12:]) / variance, np.sum(bending[12:]) / variance[-1])
    assert np.sum(bending[12:]) >= variance[-1]


def test_a_map_that_begins_in_the_window_bends_from_the_frames_that_would_be_held():
    problem, _ = climb(np.random.default_rng(0), 1.5)
    held = np.isin(np.arange(FRAMES), [0, 9])
    np.testing.assert_array_equal(bending_of(problem), bending_of(replace(problem, fixed=held)))


def test_nothing_is_said_where_observations_do_not_determine_the_poses():
    problem, _ = climb(np.random.default_rng(0), 1.5)
    few = problem.select_observations(problem.landmark < 2)
    assert np.isnan(bending_of(few)).all()
    assert np.isnan(bending_of(replace(problem, fixed=np.ones(FRAMES, dtype=bool)))).all()

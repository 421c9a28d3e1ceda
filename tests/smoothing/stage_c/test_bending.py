from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from scipy.spatial.transform import Rotation
from synthetic_bundle import TIGHT, K, held_frames

from vgps.smoothing.stage_c.bending import bending_of
from vgps.solver.bundle_adjustment import solve
from vgps.solver.levenberg_marquardt import SolverSettings
from vgps.solver.marginals import marginal_covariances
from vgps.solver.problem import BundleProblem

FRAMES, NOISE_PX, CLIMB_M = 21, 0.3, 6.0
LOOKING_DOWN = [[1, 0, 0], [0, 0, 1], [0, -1, 0]] @ Rotation.from_euler("x", -35.0, degrees=True).as_matrix()


def climb(rng: np.random.Generator, relief_m: float) -> tuple[BundleProblem, np.ndarray]:
    """A camera rises from 2 to 5 m over ground with such a relief; the problem begins at the truth."""
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3], poses[:, 2, 3] = LOOKING_DOWN, np.linspace(2.0, 2.0 + CLIMB_M, FRAMES)
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
    """Variance about an axis by which the upper half of the path is turned against the lower one, as drawn,
    and as a random walk of the rotation with the stated bending would have it, rad^2."""
    problem, _ = climb(np.random.default_rng(seed), relief_m)
    scale = FRAMES // 2
    tie = gtsam.RangeFactorPose3(X(0), X(scale), 0.5 * CLIMB_M, gtsam.noiseModel.Isotropic.Sigma(1, 1e-6))
    graph = gtsam.NonlinearFactorGraph()
    graph.push_back(tie)
    problem = replace(problem, fixed=np.arange(FRAMES) == 0, pose_graph=graph)
    result = solve(problem, SolverSettings(relative_tolerance=1e-8)).problem
    centre = result.world_T_camera[:, :3, 3]
    halves = np.diff(centre[[0, FRAMES // 2, FRAMES - 1]], axis=0)
    turned = (halves / np.linalg.norm(halves, axis=1)[:, None])[:, :2]
    bending = bending_of(result)
    return 0.5 * float(np.sum((turned[1] - turned[0]) ** 2)), float(np.nansum(bending)) / 3.0


@pytest.mark.slow
def test_the_path_of_a_climb_bends_as_stated_and_most_over_flat_ground():
    """Over flat ground the cost is no parabola there, so that its curvature says too much."""
    flat, hilly, rough = (
        np.sqrt(np.mean([solved(relief_m, seed) for seed in range(seeds)], axis=0))
        for relief_m, seeds in ((0.0, 5), (0.3, 12), (1.5, 12))  # the flat ones take many steps
    )
    for drawn, stated in (hilly, rough):
        assert 0.6 < drawn / stated < 1.6
    assert flat[1] > flat[0] > 1.5 * hilly[0] > 3.0 * rough[0]


def test_the_bending_is_the_growth_of_the_rotations_variance_since_the_frame_that_is_held():
    problem = solve(held_frames(), TIGHT).problem
    problem = replace(problem, fixed=np.arange(40) < 12)
    covariance = marginal_covariances(problem).poses[:, :3, :3]
    variance = np.maximum.accumulate(np.trace(covariance, axis1=1, axis2=2)[12:] / 3.0)
    bending = bending_of(problem)
    assert np.isnan(bending[:12]).all()
    np.testing.assert_allclose(np.cumsum(bending[12:]), variance, rtol=0.1)


def test_noise_of_a_short_way_is_no_bend():
    """A camera that starts again moves by less than its positions are known to."""
    problem, true = climb(np.random.default_rng(0), 1.5)
    short = true.copy()
    short[:, 2, 3] = 2.0 + 0.002 * np.arange(FRAMES)
    points, landmark = problem.world_p_landmark, problem.landmark
    p = np.einsum("fji,fj->fi", short[problem.frame, :3, :3], points[landmark] - short[problem.frame, :3, 3])
    problem = replace(problem, world_T_camera=short, uv_px=p[:, :2] / p[:, 2:] * K[:2] + K[2:])
    known = replace(problem, fixed=np.arange(FRAMES) < 5, sigma_px=np.full(len(p), 3.0))
    covariance = marginal_covariances(known).poses[-1]
    assert np.sqrt(np.trace(covariance[3:, 3:])) > 0.3 * 0.002 * FRAMES
    assert np.nansum(bending_of(known)) < 4.0 * np.trace(covariance[:3, :3]) / 3.0


def test_a_map_that_begins_in_the_window_bends_from_its_first_frame():
    problem, _ = climb(np.random.default_rng(0), 1.5)
    held = np.arange(FRAMES) == 0
    np.testing.assert_array_equal(bending_of(problem), bending_of(replace(problem, fixed=held)))
    assert np.flatnonzero(np.isnan(bending_of(problem))).tolist() == [0]


def test_nothing_is_said_where_observations_do_not_determine_the_poses():
    problem, true = climb(np.random.default_rng(0), 1.5)
    assert np.isnan(bending_of(problem.select_observations(problem.landmark < 2))).all()
    assert np.isnan(bending_of(replace(problem, fixed=np.ones(FRAMES, dtype=bool)))).all()
    standing = replace(problem, world_T_camera=np.tile(true[0], (FRAMES, 1, 1)))
    assert np.isnan(bending_of(standing)).all()

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.geometry import project, reprojection_inliers
from vgps.tracking.pose import lmeds_pose, refine_pose

K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
TRUTH = np.eye(4)
TRUTH[:3, :3] = Rotation.from_rotvec([0.05, -0.1, 0.02]).as_matrix()
TRUTH[:3, 3] = [0.3, -0.1, 0.5]


@pytest.fixture
def matches():
    rng = np.random.default_rng(3)
    points = rng.uniform([-5, -4, 6], [5, 4, 30], (120, 3))
    return points, project(K, TRUTH, points)[0]


def test_refine_returns_to_the_exact_pose(matches):
    points, uv = matches
    start = TRUTH.copy()
    start[:3, 3] += [0.2, -0.1, 0.3]
    pose, _ = refine_pose(K, start, points, uv, np.ones(len(points)), huber_px=1e3, iterations=20)
    np.testing.assert_allclose(pose, TRUTH, atol=1e-8)


def test_information_predicts_the_scatter_of_the_pose(matches):
    points, uv = matches
    rng = np.random.default_rng(0)
    sigma, centres = 0.5, []
    for _ in range(200):
        noisy = uv + rng.normal(0, sigma, uv.shape)
        pose, information = refine_pose(K, TRUTH, points, noisy, np.full(len(uv), 0.5 / sigma**2), 1e3)
        centres.append(TRUTH[:3, :3].T @ (pose[:3, 3] - TRUTH[:3, 3]))
    stated = np.sqrt(np.diag(np.linalg.inv(information)))[3:]
    np.testing.assert_allclose(np.std(centres, axis=0), stated, rtol=0.2)


def test_least_median_of_squares_survives_forty_percent_outliers(matches):
    points, uv = matches
    rng = np.random.default_rng(1)
    bad = rng.choice(len(uv), 48, replace=False)
    uv = uv + rng.normal(0, 0.2, uv.shape)
    uv[bad] += rng.uniform(20, 80, (48, 2))
    far_off = np.eye(4)
    far_off[:3, 3] = [3.0, 0, -2.0]
    pose, median = lmeds_pose(K, points, uv, far_off[None], 200, rng)
    assert median < 1.0
    agree = reprojection_inliers(K, pose, points, uv, 5.0)
    assert not agree[bad].any() and agree.sum() > 60


def test_no_samples_are_drawn_when_a_guess_already_fits(matches):
    points, uv = matches
    pose, median = lmeds_pose(K, points, uv, TRUTH[None], 50, np.random.default_rng(0), good_px=0.5)
    np.testing.assert_array_equal(pose, TRUTH)
    assert median < 1e-9

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.geometry import project
from vgps.tracking.pose import Correspondences, Prediction, lmeds_pose, refine_pose

K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
TRUTH = np.eye(4)
TRUTH[:3, :3] = Rotation.from_rotvec([0.05, -0.1, 0.02]).as_matrix()
TRUTH[:3, 3] = [0.3, -0.1, 0.5]


@pytest.fixture
def matches():
    rng = np.random.default_rng(3)
    points = rng.uniform([-5, -4, 6], [5, 4, 30], (120, 3))
    return Correspondences(points, project(K, TRUTH, points)[0])


def test_refine_returns_to_the_exact_pose(matches):
    start = TRUTH.copy()
    start[:3, 3] += [0.2, -0.1, 0.3]
    pose, _ = refine_pose(K, start, matches, np.ones(len(matches)), iterations=30)
    np.testing.assert_allclose(pose, TRUTH, atol=1e-8)


def test_one_late_outlier_hardly_moves_the_pose(matches):
    """Least squares would move the camera by 30 mm, the Huber weight lets 100 px count like 1 px."""
    uv = matches.uv_px.copy()
    uv[0] += [100.0, 0.0]
    pose, _ = refine_pose(K, TRUTH, Correspondences(matches.points, uv), np.ones(len(uv)), 30)
    assert np.linalg.norm(pose[:3, 3] - TRUTH[:3, 3]) < 0.003


def test_the_information_predicts_the_scatter_of_the_pose(matches):
    rng = np.random.default_rng(0)
    sigma, errors = 0.2, []
    mu = np.full(len(matches), 0.5 / sigma**2)
    for _ in range(200):
        noisy = Correspondences(matches.points, matches.uv_px + rng.normal(0, sigma, matches.uv_px.shape))
        pose, information = refine_pose(K, TRUTH, noisy, mu)
        errors.append(TRUTH[:3, :3].T @ (pose[:3, 3] - TRUTH[:3, 3]))
    expected = np.sqrt(np.diag(np.linalg.inv(information)))[3:]
    np.testing.assert_allclose(np.std(errors, axis=0), expected, rtol=0.2)


def test_least_median_of_squares_resists_forty_percent_outliers(matches):
    rng = np.random.default_rng(1)
    bad = rng.choice(len(matches), 48, replace=False)
    uv = matches.uv_px + rng.normal(0, 0.2, matches.uv_px.shape)
    uv[bad] += rng.uniform(20, 80, (48, 2))
    wrong = np.eye(4)
    wrong[:3, 3] = [3.0, 0, -2.0]
    disturbed = Correspondences(matches.points, uv)
    pose = lmeds_pose(K, disturbed, wrong[None], 200, rng)
    inliers = disturbed.inliers(K, pose, 5.0)
    assert not inliers[bad].any() and inliers.sum() > 60


def test_no_samples_are_drawn_when_a_guess_already_fits(matches):
    rng = np.random.default_rng(0)
    before = rng.bit_generator.state
    pose = lmeds_pose(K, matches, TRUTH[None], 50, rng, good_px=0.5)
    np.testing.assert_array_equal(pose, TRUTH)
    assert rng.bit_generator.state == before


def test_a_guess_that_fits_no_better_than_the_limit_competes_with_samples(matches):
    wrong = TRUTH.copy()
    wrong[0, 3] += 0.1
    pose = lmeds_pose(K, matches, wrong[None], 20, np.random.default_rng(0), good_px=0.5)
    np.testing.assert_allclose(pose, TRUTH, atol=1e-4)


def test_points_behind_the_camera_are_no_inliers(matches):
    turned = TRUTH @ np.diag([-1.0, 1.0, -1.0, 1.0])
    uv = project(K, TRUTH, matches.points)[0]
    assert not Correspondences(matches.points, uv).inliers(K, turned, 1e9).any()


def test_a_rotation_by_a_gyro_counts_as_an_observation():
    """Beside features of one direction, which show no rotation about it, the gyro decides."""
    rng = np.random.default_rng(3)
    points = np.array([[0.0, 0.0, 8.0]]) + rng.normal(0.0, 1e-3, (20, 3))
    uv, _ = project(K, np.eye(4), points)
    matches = Correspondences(points, uv + rng.normal(0.0, 0.3, uv.shape))
    roll = np.eye(4)
    roll[:3, :3] = Rotation.from_euler("z", 5.0, degrees=True).as_matrix()
    free, _ = refine_pose(K, roll, matches, np.ones(20))
    prior = Prediction(np.eye(4), np.radians(0.1))
    held, information = refine_pose(K, roll, matches, np.ones(20), prior=prior)
    assert np.degrees(Rotation.from_matrix(free[:3, :3]).magnitude()) > 1.0
    assert np.degrees(Rotation.from_matrix(held[:3, :3]).magnitude()) < 0.01
    assert information[2, 2] == pytest.approx(np.radians(0.1) ** -2, rel=0.1)

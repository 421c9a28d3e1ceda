import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.config import RotationConfig
from vgps.tracking.epipolar_fit import TwoViews, fit_epipolar_geometry

FOCAL_PX = 500.0
SECOND_R_FIRST = Rotation.from_rotvec([0.02, -0.05, 0.03]).as_matrix()
DIRECTION = np.array([0.6, 0.0, 0.8])  # of the first camera's centre, in the second's axes
CONFIG = RotationConfig()


def views(noise_px=0.0, behind=0):
    """100 points 4 to 20 m away and a step of half a metre; the first points as if behind the cameras."""
    rng = np.random.default_rng(0)
    rays = np.column_stack([rng.uniform(-0.5, 0.5, (100, 2)), np.ones(100)])
    depth = rng.uniform(4.0, 20.0, 100)
    depth[:behind] *= -1.0
    second = (depth[:, None] * rays) @ SECOND_R_FIRST.T + 0.5 * DIRECTION
    second = second / second[:, 2:]
    second[:, :2] += noise_px / FOCAL_PX * rng.normal(size=(100, 2))
    return TwoViews(rays, second, FOCAL_PX)


def fit(these):
    """The fit from half a degree and 16 degrees off."""
    rotation = SECOND_R_FIRST @ Rotation.from_rotvec([0.01, 0.01, 0.0]).as_matrix()
    return fit_epipolar_geometry(rotation, np.array([0.8, 0.1, 0.6]) / np.sqrt(1.01), these, CONFIG, 20)


def test_exact_rays_give_rotation_and_direction():
    found = fit(views())
    np.testing.assert_allclose(found.second_R_first, SECOND_R_FIRST, atol=1e-6)
    np.testing.assert_allclose(found.direction, DIRECTION, atol=1e-4)
    assert found.inlier_share == 1.0 and found.cost < 1e-6


def test_features_behind_the_cameras_are_no_inliers_and_cost_one():
    found = fit(views(behind=20))
    assert 0.75 < found.inlier_share < 0.9  # the farthest show too little parallax to tell
    assert found.cost == pytest.approx(1.0 - found.inlier_share, abs=0.01)


def test_mismatches_are_no_inliers_and_do_not_move_the_rotation():
    disturbed = views()
    disturbed.second[:20, 1] += 30.0 / FOCAL_PX
    found = fit(disturbed)
    np.testing.assert_allclose(found.second_R_first, SECOND_R_FIRST, atol=2e-3)
    assert found.inlier_share == pytest.approx(0.8, abs=0.03)


def test_the_covariance_grows_with_the_square_of_the_noise_and_has_a_floor():
    exact, fine, coarse = (np.trace(fit(views(noise_px=noise)).covariance) for noise in (0.0, 0.1, 0.3))
    assert coarse / fine == pytest.approx(9.0, rel=0.5)
    residual_px = CONFIG.sigma_floor_px
    assert exact == pytest.approx(fine * (residual_px / 0.1) ** 2, rel=0.5)

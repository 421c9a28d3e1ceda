import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from textured_wall import CAMERA, picture, pose_at, views_from

from vgps.config import LocalizationConfig
from vgps.localization.search import ExpectedLandmarks, match_sigma_px, required_inliers, search_frame
from vgps.localization.template_rendering import render_templates

POSE = pose_at(0.3)
IMAGE = picture(POSE)
VIEWS = views_from(POSE, 60)
CONFIG = LocalizationConfig()


def expected_at(pose):
    templates = render_templates(CAMERA.K, pose, VIEWS, np.zeros((len(VIEWS), 2)), 15)
    return ExpectedLandmarks(VIEWS, templates, np.zeros((len(VIEWS), 2)))


def search(image, pose, expected, radius=12.0):
    return search_frame(image, CAMERA.K, pose, expected, np.full(len(expected.views), radius), CONFIG)


def test_the_pose_is_found_from_one_nearby():
    nearby = POSE.copy()
    nearby[:3, :3] = nearby[:3, :3] @ Rotation.from_euler("xyz", (1, -1, 0.5), degrees=True).as_matrix()
    nearby[:3, 3] += (0.1, -0.1, 0.1)
    result = search(IMAGE, nearby, expected_at(nearby))
    assert np.linalg.norm(result.pose.world_T_camera[:3, 3] - POSE[:3, 3]) < 0.03
    assert len(result.matches) == result.pose.inlier.sum() > 0.8 * len(VIEWS)
    assert result.correlation > 0.9


def test_another_image_gives_no_pose():
    result = search(picture(pose_at(9.0)), POSE, expected_at(POSE))
    assert result.pose is None


def test_without_landmarks_there_is_no_pose():
    result = search(IMAGE, POSE, expected_at(POSE).take(np.zeros(0, int)))
    assert result.pose is None
    assert (len(result.matches), result.correlation) == (0, 0.0)


@pytest.mark.parametrize(("matches", "required"), [(0, 6), (24, 6), (25, 7), (100, 25)])
def test_six_inliers_or_a_quarter_are_required(matches, required):
    assert required_inliers(matches, CONFIG) == required


def test_sigma_of_a_match_by_hand():
    # 0.5 px of matching, 0.3 of the landmark, 300 px * 0.01 m / 10 m of its position
    sigma = match_sigma_px(CAMERA.K, VIEWS, np.full(len(VIEWS), 10.0), CONFIG)
    np.testing.assert_allclose(sigma, np.sqrt(0.5**2 + 0.3**2 + 0.3**2))

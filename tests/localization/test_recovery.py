import numpy as np
import pytest
from textured_wall import CAMERA, exposed, pose_at

from vgps.config import LocalizationConfig
from vgps.localization.recovery import DescriptorRecovery


def unchanged(uv_px):
    """Pixels of a global shutter."""
    return uv_px


@pytest.fixture(scope="module")
def keyframes(database):
    return database.keyframes()


@pytest.mark.parametrize("t_s", [0.2, 1.0])
def test_the_first_candidate_is_the_cameras_pose(keyframes, t_s):
    recovery = DescriptorRecovery(keyframes, CAMERA.K, LocalizationConfig())
    found = recovery.candidates(exposed(t_s, 0.01), unchanged)
    assert found
    assert np.linalg.norm(found[0][:3, 3] - pose_at(t_s)[:3, 3]) < 0.3


@pytest.mark.parametrize("image", [np.zeros((240, 320), np.float32), np.full((240, 320), 300, np.float32)])
def test_an_empty_image_has_no_candidates(keyframes, image):
    assert DescriptorRecovery(keyframes, CAMERA.K, LocalizationConfig()).candidates(image, unchanged) == []


def test_noise_has_no_candidates(keyframes):
    noise = np.random.default_rng(0).uniform(0, 255, (240, 320)).astype(np.float32)
    assert DescriptorRecovery(keyframes, CAMERA.K, LocalizationConfig()).candidates(noise, unchanged) == []


def test_a_database_without_keyframes_has_no_candidates():
    recovery = DescriptorRecovery((), CAMERA.K, LocalizationConfig())
    assert recovery.candidates(exposed(0.0, 0.01), unchanged) == []

import numpy as np
import pytest
from textured_wall import CAMERA, WallDatabase, exposed, pose_at

from vgps.camera import distort
from vgps.config import LocalizationConfig
from vgps.landmarks.descriptors import describe
from vgps.landmarks.rectify import Rectifier
from vgps.localization.recovery import DescriptorRecovery
from vgps.model import Camera


@pytest.fixture(scope="module")
def keyframes():
    return WallDatabase().keyframes()


@pytest.mark.parametrize("t_s", [0.2, 1.0])
def test_the_camera_is_found_without_a_prediction(keyframes, t_s):
    recovery = DescriptorRecovery(keyframes, describe, CAMERA.K, LocalizationConfig())
    found = recovery.candidates(exposed(t_s, 0.01))
    assert found
    assert np.linalg.norm(found[0][:3, 3] - pose_at(t_s)[:3, 3]) < 0.3


@pytest.mark.parametrize("image", [np.zeros((240, 320), np.float32), np.full((240, 320), 300, np.float32)])
def test_an_empty_image_has_no_candidates(keyframes, image):
    assert DescriptorRecovery(keyframes, describe, CAMERA.K, LocalizationConfig()).candidates(image) == []


def test_noise_has_no_candidates(keyframes):
    noise = np.random.default_rng(0).uniform(0, 255, (240, 320)).astype(np.float32)
    assert DescriptorRecovery(keyframes, describe, CAMERA.K, LocalizationConfig()).candidates(noise) == []


def test_a_database_without_keyframes_has_no_candidates():
    recovery = DescriptorRecovery((), describe, CAMERA.K, LocalizationConfig())
    assert recovery.candidates(exposed(0.0, 0.01)) == []


def test_an_image_is_undistorted():
    # black left of a column of the distorted image, bright right of it
    lens = Camera(
        model="opencv",
        width=320,
        height=240,
        fx=300.0,
        fy=300.0,
        cx=160.0,
        cy=120.0,
        distortion=(-0.2, 0.05, 0.001, -0.002),
    )
    u, v = np.meshgrid(np.arange(320.0), np.arange(240.0))
    flat = np.column_stack([u.ravel(), v.ravel()])
    seen = distort(lens, flat)
    checked = ((seen > 2) & (seen < (316, 236))).all(axis=1)
    image = np.zeros((240, 320), np.uint8)
    image[:, 100:] = 200
    out = Rectifier(lens)(image).ravel()
    clear = checked & (np.abs(seen[:, 0] - 99.5) > 1.5)
    np.testing.assert_array_equal(out[clear] > 100, seen[clear, 0] > 99.5)


def test_a_pinhole_image_stays_as_it_is():
    image = np.random.default_rng(1).integers(0, 255, (240, 320)).astype(np.uint8)
    np.testing.assert_array_equal(Rectifier(CAMERA)(image), image)

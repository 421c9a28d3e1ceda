from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from textured_wall import CAMERA, GYRO_R_CAMERA, exposed, gyro, pose_at, rolling

from vgps.config import LocalizationConfig
from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.prediction import MotionState, RotationPredictor
from vgps.localization.recovery import DescriptorRecovery
from vgps.localization.row_motion import RowMotion


def unchanged(uv_px):
    """Pixels of a global shutter."""
    return uv_px


@pytest.fixture(scope="module")
def keyframes(database):
    return database.keyframes()


@pytest.mark.slow
@pytest.mark.parametrize("t_s", [0.2, 1.0])
def test_the_first_candidate_is_the_cameras_pose(keyframes, t_s):
    recovery = DescriptorRecovery(keyframes, CAMERA.K, LocalizationConfig())
    found = recovery.candidates(exposed(t_s, 0.01), unchanged)
    assert found
    assert np.linalg.norm(found[0][:3, 3] - pose_at(t_s)[:3, 3]) < 0.3


@pytest.mark.slow
def test_a_pose_is_recovered_from_pixels_of_the_middle_row(keyframes):
    rows = RowMotion(
        replace(CAMERA, readout_s=0.03), RotationPredictor(GyroIntegral(gyro(2.0)), GYRO_R_CAMERA), 0.5
    )
    recovery = DescriptorRecovery(keyframes, CAMERA.K, LocalizationConfig())
    away_m = []
    for t_s in np.arange(0.1, 1.8, 0.2).tolist():
        undone = partial(rows.at_middle_row, MotionState(t_s=t_s, world_T_camera=np.eye(4)))
        image = rolling(t_s, 0.03).astype(np.float32)
        found = [recovery.candidates(image, at_middle_row)[0] for at_middle_row in (undone, unchanged)]
        away_m.append([np.linalg.norm((pose - pose_at(t_s))[:3, 3]) for pose in found])
    modelled, ignored = np.median(away_m, axis=0)
    assert modelled < 0.6 * ignored


@pytest.mark.slow
@pytest.mark.parametrize("image", [np.zeros((240, 320), np.float32), np.full((240, 320), 300, np.float32)])
def test_an_empty_image_has_no_candidates(keyframes, image):
    assert DescriptorRecovery(keyframes, CAMERA.K, LocalizationConfig()).candidates(image, unchanged) == []


@pytest.mark.slow
def test_noise_has_no_candidates(keyframes):
    noise = np.random.default_rng(0).uniform(0, 255, (240, 320)).astype(np.float32)
    assert DescriptorRecovery(keyframes, CAMERA.K, LocalizationConfig()).candidates(noise, unchanged) == []


def test_a_database_without_keyframes_has_no_candidates():
    recovery = DescriptorRecovery((), CAMERA.K, LocalizationConfig())
    assert recovery.candidates(exposed(0.0, 0.01), unchanged) == []

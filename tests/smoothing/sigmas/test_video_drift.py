"""Drift of the video: its draws, and the size that an IMU shows."""

from types import SimpleNamespace

import numpy as np
import pytest

from vgps.config import DriftConfig
from vgps.smoothing.sigmas.video_drift import drift_by_imu, drift_draws

FRAMES = 301
GYRO_SIGMA_RAD = 1e-3


@pytest.fixture(scope="module")
def drive():
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, 2, 3] = np.arange(FRAMES)
    return SimpleNamespace(world_T_camera=poses), SimpleNamespace(free=np.arange(FRAMES), n_free=FRAMES)


def rotations_between_frames(drift):
    """What a gyro notes of a deformation (6 F, K), over its sigma; it does not see the scale."""
    rotation = drift.reshape(FRAMES, 6, -1)[:, :3]
    return (np.diff(rotation[::15], axis=0) / GYRO_SIGMA_RAD).reshape(-1, drift.shape[1])


def test_the_gyro_shows_how_much_the_video_turns_and_nothing_of_its_scale(drive):
    expected = DriftConfig(rotation_sigma_deg=0.3, scale_sigma=0.05)
    true = expected.model_copy(update={"rotation_sigma_deg": 0.05})
    one = drift_draws(*drive, true, 1, np.random.default_rng(5))
    found = drift_by_imu(*drive, expected, rotations_between_frames(one)[:, 0], rotations_between_frames)
    assert found.rotation_sigma_deg == pytest.approx(0.05, rel=0.3)
    assert found.scale_sigma == expected.scale_sigma


def test_residuals_beyond_the_expected_drift_leave_it_as_it_is(drive):
    expected = DriftConfig()
    found = drift_by_imu(*drive, expected, np.full(60, 100.0), rotations_between_frames)
    assert found == expected

import numpy as np
import pytest
from angles import apart_deg
from scipy.spatial.transform import Rotation
from textured_wall import GYRO_R_CAMERA, gyro, pose_at

from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.bridging import bridge_gaps
from vgps.localization.prediction import RotationPredictor

T = np.arange(20) / 10
TRUE = np.array([pose_at(t) for t in T])
WITH_GYRO = RotationPredictor(GyroIntegral(gyro(2.0)), GYRO_R_CAMERA)


def bridged(lost, rotations=WITH_GYRO, coast_s=3.0):
    tracked = np.ones(len(T), bool)
    tracked[lost] = False
    poses = np.where(tracked[:, None, None], TRUE, np.nan)
    return bridge_gaps(T, poses, tracked, rotations, np.zeros(3), coast_s)


def test_a_gap_follows_the_gyro():
    out = bridged(slice(6, 14))
    assert apart_deg(out, TRUE).max() < 0.02
    assert np.linalg.norm(out[:, :3, 3] - TRUE[:, :3, 3], axis=1).max() < 0.02


def test_the_error_of_the_gyro_is_spread_over_the_gap():
    # a gyro with an unknown bias of 2 deg/s would be 1.8 deg off at the far end
    bias = np.radians([2.0, 0, 0])
    out = bridged(slice(6, 14), RotationPredictor(GyroIntegral(gyro(2.0, tuple(bias))), GYRO_R_CAMERA))
    assert apart_deg(out, TRUE).max() < 0.3
    assert apart_deg(out, TRUE)[[5, 14]].max() == pytest.approx(0, abs=1e-5)


def test_without_a_gyro_the_rotation_is_even():
    out = bridged(slice(6, 8), RotationPredictor(None, None))
    steps = Rotation.from_matrix(out[5:8, :3, :3].transpose(0, 2, 1) @ out[6:9, :3, :3]).as_rotvec()
    np.testing.assert_allclose(steps, np.tile(steps[0], (3, 1)), atol=1e-9)


def test_a_gyro_that_ends_within_the_gap_is_not_used():
    lost = slice(4, 16)
    out = bridged(lost, RotationPredictor(GyroIntegral(gyro(0.9)), GYRO_R_CAMERA))
    np.testing.assert_allclose(out, bridged(lost, RotationPredictor(None, None)), atol=1e-9)


def test_beyond_the_tracked_frames_the_gyro_continues_and_the_velocity_for_coast_s():
    out = bridged(np.r_[0:4, 16:20], coast_s=0.2)
    assert apart_deg(out, TRUE).max() < 0.02
    velocity = (TRUE[15, :3, 3] - TRUE[14, :3, 3]) / 0.1
    np.testing.assert_allclose(out[17, :3, 3], TRUE[15, :3, 3] + 0.2 * velocity, atol=1e-9)
    np.testing.assert_allclose(out[19, :3, 3], out[17, :3, 3], atol=1e-9)


def test_tracked_frames_are_unchanged():
    np.testing.assert_array_equal(bridged(slice(3, 9))[9:], TRUE[9:])


def test_a_single_tracked_frame_is_enough():
    out = bridged(np.r_[0:7, 8:20])
    assert np.isfinite(out).all()
    np.testing.assert_allclose(out[:, :3, 3], np.tile(TRUE[7, :3, 3], (20, 1)))

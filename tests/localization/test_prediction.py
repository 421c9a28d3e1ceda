from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from textured_wall import GYRO_R_CAMERA, gyro, pose_at

from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.prediction import (
    MotionState,
    RotationPredictor,
    exposure_motion_px,
    interval_motion_px,
    predict,
    search_radius_px,
)
from vgps.model import GyroLog

K = np.array([[720.0, 0, 320], [0, 720, 150], [0, 0, 1]])
STILL = MotionState(0.0, np.eye(4), None, np.zeros(3), np.zeros(3))


def steady_gyro(rate, mount):
    t = np.arange(-1, 1, 0.005)
    return GyroLog(t, np.tile(mount @ rate, (len(t), 1)), Path("gyro.csv"))


def test_window_by_hand():
    # 720 px * 1.5 m/s * 0.1 s / 20 m + 4 px = 5.4 + 4
    np.testing.assert_allclose(search_radius_px(720, np.array([20.0, 108.0]), 1.5, 0.1, 4.0), [9.4, 5.0])


@pytest.mark.parametrize("end_s", [0.3, -0.2])
def test_a_steady_turn_is_the_exponential(end_s):
    rate = np.array([0.5, -1.0, 0.3])
    rotations = RotationPredictor(GyroIntegral(steady_gyro(rate, GYRO_R_CAMERA)), GYRO_R_CAMERA)
    expected = Rotation.from_rotvec(rate * end_s).as_matrix()
    np.testing.assert_allclose(rotations.relative_rotation(STILL, 0.0, end_s), expected, atol=1e-12)


def test_the_bias_is_taken_off():
    rate, bias = np.array([0.5, -1.0, 0.3]), np.array([0.02, 0.01, -0.03])
    log = steady_gyro(rate, GYRO_R_CAMERA)
    rotations = RotationPredictor(
        GyroIntegral(GyroLog(log.t_s, log.rate_rad_s + bias, log.source)), GYRO_R_CAMERA
    )
    motion = MotionState(0.0, np.eye(4), None, np.zeros(3), bias)
    np.testing.assert_allclose(
        rotations.relative_rotation(motion, 0.0, 0.2),
        Rotation.from_rotvec(0.2 * rate).as_matrix(),
        atol=1e-12,
    )


def test_without_a_gyro_the_last_rate_goes_on():
    motion = MotionState(0.0, np.eye(4), None, np.array([0.0, 2.0, 0.0]), np.zeros(3))
    for rotations in (RotationPredictor(None, None), RotationPredictor(GyroIntegral(gyro(0.5)), None)):
        assert not rotations.covers(0.0, 0.1)
        np.testing.assert_allclose(
            rotations.relative_rotation(motion, 0, 0.1), Rotation.from_euler("y", 0.2).as_matrix()
        )


def test_beyond_the_log_the_gyro_does_not_tell():
    rotations = RotationPredictor(GyroIntegral(gyro(0.5)), GYRO_R_CAMERA)
    assert rotations.covers(0.0, 0.5)
    assert not rotations.covers(0.5, 3.0)


def test_the_predicted_pose_is_where_the_camera_goes():
    rotations = RotationPredictor(GyroIntegral(gyro(1.0)), GYRO_R_CAMERA)
    before, now = pose_at(0.4), pose_at(0.5)
    motion = MotionState(0.5, now, (now[:3, 3] - before[:3, 3]) / 0.1, np.zeros(3), np.zeros(3))
    predicted, true = predict(motion, rotations, 0.6), pose_at(0.6)
    turned = Rotation.from_matrix(predicted[:3, :3].T @ true[:3, :3]).magnitude()
    assert np.degrees(turned) < 0.01
    assert np.linalg.norm(predicted[:3, 3] - true[:3, 3]) < 0.002


def test_the_centre_is_extrapolated_not_the_translation_of_world_to_camera():
    # a camera far from the origin that turns about itself stays where it is
    pose = np.eye(4)
    pose[:3, 3] = (100, 0, 0)
    motion = MotionState(0.0, pose, np.zeros(3), np.array([0, 1.0, 0]), np.zeros(3))
    np.testing.assert_allclose(predict(motion, RotationPredictor(None, None), 0.1)[:3, 3], [100, 0, 0])


def test_blur_of_a_turn_by_hand():
    # 0.5 rad/s about y for 0.06 s, seen on the axis: 720 * 2 tan(0.015) px to the left
    motion = MotionState(0.0, np.eye(4), None, np.array([0, 0.5, 0]), np.zeros(3))
    blur = exposure_motion_px(K, motion, RotationPredictor(None, None), 0.0, 0.06, np.array([[0, 0, 10.0]]))
    np.testing.assert_allclose(blur, [[-720 * 2 * np.tan(0.015), 0]], atol=1e-9)


def test_blur_of_the_paper_is_the_motion_between_frames_by_the_share_of_the_exposure():
    last, predicted = np.eye(4), np.eye(4)
    predicted[:3, :3] = Rotation.from_euler("y", 0.05).as_matrix()
    predicted[0, 3] = 0.2
    points = np.array([[1.0, 0.5, 8], [-2, 1, 20]])
    expected = 0.6 * (project(K, last, points)[0] - project(K, predicted, points)[0])
    np.testing.assert_allclose(interval_motion_px(K, last, predicted, 0.6, points), expected)

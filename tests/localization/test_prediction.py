from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from angles import apart_deg
from scipy.spatial.transform import Rotation
from textured_wall import GYRO_R_CAMERA, gyro, pose_at

from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.prediction import (
    MotionState,
    RotationPredictor,
    exposure_motion_px,
    interval_motion_px,
    predict_pose,
    search_radius_px,
)
from vgps.model import GyroLog

K = np.array([[720.0, 0, 320], [0, 720, 150], [0, 0, 1]])
STILL = MotionState(t_s=0.0, world_T_camera=np.eye(4))


def steady_gyro(rate, mount):
    t = np.arange(-1, 1, 0.005)
    return GyroLog(t, np.tile(mount @ rate, (len(t), 1)), Path("gyro.csv"))


def test_the_window_of_hand_computed_values():
    # 720 px * 1.5 m/s * 0.1 s / 20 m + 4 px = 5.4 + 4
    np.testing.assert_allclose(search_radius_px(720, np.array([20.0, 108.0]), 1.5, 0.1, 4.0), [9.4, 5.0])


@pytest.mark.parametrize("end_s", [0.3, -0.2])
def test_a_constant_rate_gives_the_exponential(end_s):
    rate = np.array([0.5, -1.0, 0.3])
    rotations = RotationPredictor(GyroIntegral(steady_gyro(rate, GYRO_R_CAMERA)), GYRO_R_CAMERA)
    expected = Rotation.from_rotvec(rate * end_s).as_matrix()
    np.testing.assert_allclose(rotations.relative_rotation(STILL, 0.0, end_s), expected, atol=1e-12)


def test_the_bias_is_subtracted():
    rate, bias = np.array([0.5, -1.0, 0.3]), np.array([0.02, 0.01, -0.03])
    log = steady_gyro(rate, GYRO_R_CAMERA)
    rotations = RotationPredictor(
        GyroIntegral(GyroLog(log.t_s, log.rate_rad_s + bias, log.source)), GYRO_R_CAMERA
    )
    motion = replace(STILL, gyro_bias_rad_s=bias)
    np.testing.assert_allclose(
        rotations.relative_rotation(motion, 0.0, 0.2),
        Rotation.from_rotvec(0.2 * rate).as_matrix(),
        atol=1e-12,
    )


def test_without_a_gyro_the_angular_rate_is_constant():
    motion = replace(STILL, camera_w_rad_s=np.array([0.0, 2.0, 0.0]))
    for rotations in (RotationPredictor(None, None), RotationPredictor(GyroIntegral(gyro(0.5)), None)):
        assert not rotations.covers(0.0, 0.1)
        np.testing.assert_allclose(
            rotations.relative_rotation(motion, 0, 0.1), Rotation.from_euler("y", 0.2).as_matrix()
        )


def test_the_gyro_does_not_cover_times_beyond_its_log():
    rotations = RotationPredictor(GyroIntegral(gyro(0.5)), GYRO_R_CAMERA)
    assert rotations.covers(0.0, 0.5)
    assert not rotations.covers(0.5, 3.0)


def test_the_predicted_pose_is_close_to_the_true_one():
    rotations = RotationPredictor(GyroIntegral(gyro(1.0)), GYRO_R_CAMERA)
    before, now = pose_at(0.4), pose_at(0.5)
    motion = MotionState(t_s=0.5, world_T_camera=now, world_v_camera=(now[:3, 3] - before[:3, 3]) / 0.1)
    predicted, true = predict_pose(motion, rotations, 0.6), pose_at(0.6)
    assert apart_deg(predicted, true) < 0.01
    assert np.linalg.norm(predicted[:3, 3] - true[:3, 3]) < 0.002


def test_the_centre_is_extrapolated_and_not_the_translation_of_world_to_camera():
    # a camera far from the origin that rotates about itself does not move
    pose = np.eye(4)
    pose[:3, 3] = (100, 0, 0)
    motion = MotionState(
        t_s=0.0, world_T_camera=pose, world_v_camera=np.zeros(3), camera_w_rad_s=np.array([0, 1.0, 0])
    )
    np.testing.assert_allclose(predict_pose(motion, RotationPredictor(None, None), 0.1)[:3, 3], [100, 0, 0])


def test_the_blur_of_a_rotation_is_that_computed_by_hand():
    # 0.5 rad/s about y for 0.06 s, seen on the axis: 720 * 2 tan(0.015) px to the left
    motion = replace(STILL, camera_w_rad_s=np.array([0, 0.5, 0]))
    blur = exposure_motion_px(K, motion, RotationPredictor(None, None), 0.0, 0.06, np.array([[0, 0, 10.0]]))
    np.testing.assert_allclose(blur, [[-720 * 2 * np.tan(0.015), 0]], atol=1e-9)


def test_the_papers_blur_is_the_motion_between_frames_scaled_to_the_exposure():
    last, predicted = np.eye(4), np.eye(4)
    predicted[:3, :3] = Rotation.from_euler("y", 0.05).as_matrix()
    predicted[0, 3] = 0.2
    points = np.array([[1.0, 0.5, 8], [-2, 1, 20]])
    expected = 0.6 * (project(K, last, points)[0] - project(K, predicted, points)[0])
    np.testing.assert_allclose(interval_motion_px(K, last, predicted, 0.6, points), expected)

import numpy as np
from textured_wall import CAMERA, GYRO_R_CAMERA, gyro, pose_at

from vgps.config import LocalizationConfig
from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.landmark_predictor import LandmarkPredictor
from vgps.localization.prediction import (
    MotionState,
    RotationPredictor,
    exposure_motion_px,
    interval_motion_px,
)
from vgps.localization.template_rendering import render_templates

POSE = np.eye(4)  # 10 m in front of the wall
STILL = MotionState(t_s=0.0, world_T_camera=POSE)
WITH_GYRO, WITHOUT_GYRO = (
    RotationPredictor(integral, GYRO_R_CAMERA) for integral in (GyroIntegral(gyro(1.0)), None)
)


def predictor(database, rotations=WITHOUT_GYRO, exposure_s=0.0, **changes):
    def views(pose, count):
        return database.views(pose, CAMERA, max_landmarks=count)

    return LandmarkPredictor(CAMERA, views, rotations, exposure_s, LocalizationConfig(**changes))


def radius(database, motion, rotations=WITHOUT_GYRO, **changes):
    views = database.views(POSE, CAMERA, max_landmarks=5)
    return predictor(database, rotations, **changes).radius_px(0.1, motion, POSE, views)


def test_windows_by_hand(database):
    moving = MotionState(t_s=0.0, world_T_camera=POSE, world_v_camera=np.array([1.0, 0, 0]))
    # f V_max dt / depth + delta' = 300 * 15 * 0.1 / 10 + 4 with a gyro, + 24 without
    np.testing.assert_allclose(radius(database, STILL, WITH_GYRO), 45.0 + 4.0, rtol=1e-6)
    np.testing.assert_allclose(radius(database, STILL), 45.0 + 24.0, rtol=1e-6)
    # beyond a known velocity V_max is 1.5 m/s
    np.testing.assert_allclose(radius(database, moving, WITH_GYRO), 4.5 + 4.0, rtol=1e-6)
    np.testing.assert_array_equal(radius(database, moving, window="fixed"), 12.0)


def test_no_more_landmarks_than_configured(database):
    expected = predictor(database, max_landmarks=7).landmarks(0.0, STILL, POSE)
    assert len(expected.views) == len(expected.templates) == 7


def test_templates_are_blurred_by_the_motion_during_the_exposure(database):
    motion = MotionState(t_s=0.4, world_T_camera=pose_at(0.4))
    pose = pose_at(0.5)
    for blur in ("exposure", "interval", "none"):
        expected = predictor(database, WITH_GYRO, 0.06, blur=blur).landmarks(0.5, motion, pose)
        points = expected.views.world_p_landmark
        if blur == "exposure":
            motion_px = exposure_motion_px(CAMERA.K, motion, WITH_GYRO, 0.5, 0.06, points)
        elif blur == "interval":
            predicted = motion.world_T_camera.copy()
            predicted[:3, :3] @= WITH_GYRO.relative_rotation(motion, 0.4, 0.5)
            motion_px = interval_motion_px(CAMERA.K, motion.world_T_camera, predicted, 0.6, points)
        else:
            motion_px = np.zeros((len(points), 2))
        assert (np.linalg.norm(motion_px, axis=1) > 3).all() == (blur != "none")
        templates = render_templates(CAMERA.K, pose, expected.views, motion_px, 15)
        np.testing.assert_allclose(expected.templates, templates, atol=1e-3)


def test_long_motions_are_limited(database):
    spinning = MotionState(t_s=0.0, world_T_camera=POSE, camera_w_rad_s=np.array([0, 10.0, 0]))
    expected = predictor(database, exposure_s=0.06, max_blur_px=20.0).landmarks(0.0, spinning, POSE)
    motion_px = exposure_motion_px(
        CAMERA.K, spinning, WITHOUT_GYRO, 0.0, 0.06, expected.views.world_p_landmark
    )
    length = np.linalg.norm(motion_px, axis=1, keepdims=True)
    assert (length > 100).all()
    templates = render_templates(CAMERA.K, POSE, expected.views, 20.0 * motion_px / length, 15)
    np.testing.assert_allclose(expected.templates, templates, atol=1e-3)

from dataclasses import replace

import numpy as np
from textured_wall import CAMERA, GYRO_R_CAMERA, gyro, pose_at, views_from

from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.frame_estimator import motion_between
from vgps.localization.prediction import MotionState, RotationPredictor
from vgps.localization.row_motion import RowMotion

ROLLING = replace(CAMERA, readout_s=0.03)
WITH_GYRO, WITHOUT_GYRO = (
    RotationPredictor(integral, GYRO_R_CAMERA) for integral in (GyroIntegral(gyro(2.0)), None)
)
T_S = 1.05  # it turns at 40 degrees a second
POINTS = views_from(pose_at(T_S), 60).world_p_landmark


def seen_px(points: np.ndarray, readout_s: float) -> np.ndarray:
    """Where the rows of the moving camera show points."""
    uv = project(CAMERA.K, pose_at(T_S), points)[0]
    for _ in range(6):
        at_s = T_S + readout_s * (uv[:, 1] / 239 - 0.5)
        uv = np.vstack([project(CAMERA.K, pose_at(t), p[None])[0] for t, p in zip(at_s, points, strict=True)])
    return uv


def state_at(t_s: float) -> MotionState:
    """The true state, its velocities those since the frame before."""
    before = MotionState(t_s=t_s - 0.05, world_T_camera=pose_at(t_s - 0.05))
    return motion_between(before, t_s, pose_at(t_s), np.zeros(3), 0.5)


def test_the_gyro_shows_where_rows_see_landmarks() -> None:
    for readout_s in (0.03, -0.02):
        rows = RowMotion(replace(CAMERA, readout_s=readout_s), WITH_GYRO, 0.5)
        shift = rows.shifts_px(T_S, state_at(T_S - 0.05), pose_at(T_S), POINTS)
        expected = seen_px(POINTS, readout_s) - project(CAMERA.K, pose_at(T_S), POINTS)[0]
        assert np.abs(expected).max() > 1.5
        np.testing.assert_allclose(shift, expected, atol=0.05)


def test_without_a_gyro_the_camera_moves_on_as_it_did() -> None:
    shift = RowMotion(ROLLING, WITHOUT_GYRO, 0.5).shifts_px(T_S, state_at(T_S - 0.05), pose_at(T_S), POINTS)
    expected = seen_px(POINTS, 0.03) - project(CAMERA.K, pose_at(T_S), POINTS)[0]
    assert np.abs(shift - expected).max() < 0.5 * np.abs(expected).max()


def test_pixels_are_turned_back_without_knowing_their_depth() -> None:
    rows = RowMotion(ROLLING, WITH_GYRO, 0.5)
    start = MotionState(t_s=T_S, world_T_camera=np.eye(4))
    seen, middle = seen_px(POINTS, 0.03), project(CAMERA.K, pose_at(T_S), POINTS)[0]
    left = rows.at_middle_row(start, seen) - middle  # by the translation of 1 cm
    assert np.abs(left).max() < 0.4
    assert np.abs(seen - middle).max() > 1.5


def test_a_global_shutter_changes_nothing() -> None:
    rows = RowMotion(CAMERA, WITH_GYRO, 0.5)
    np.testing.assert_array_equal(rows.shifts_px(T_S, state_at(T_S), pose_at(T_S), POINTS), 0.0)
    uv = seen_px(POINTS, 0.0)
    np.testing.assert_array_equal(rows.at_middle_row(state_at(T_S), uv), uv)

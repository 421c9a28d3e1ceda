"""Prediction of the landmarks that a frame shows, their appearance and their search windows: (B) to (D)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import project
from vgps.landmarks.model import LandmarkViews
from vgps.localization.prediction import (
    MotionState,
    RotationPredictor,
    exposure_motion_px,
    interval_motion_px,
    predict_pose,
    search_radius_px,
)
from vgps.localization.row_motion import RowMotion
from vgps.localization.search import ExpectedLandmarks
from vgps.localization.template_rendering import render_templates
from vgps.model import Camera, FloatArray

ViewSource = Callable[[FloatArray, int], LandmarkViews]
"""The best views for a pose (4, 4): one per landmark, most promising first, at most this many."""


class LandmarkPredictor:
    """Predicts what a frame shows of the database.

    Args:
        camera: Of the video.
        views: The database's best views for a pose.
        rotations: Of the camera between frames.
        exposure_s: Of a frame; 0 if unknown, then templates are not blurred.
        config: Settings.
    """

    def __init__(
        self,
        camera: Camera,
        views: ViewSource,
        rotations: RotationPredictor,
        exposure_s: float,
        config: LocalizationConfig,
    ) -> None:
        self._K, self._views, self._rotations = camera.K, views, rotations
        self._exposure_s, self._config = exposure_s, config
        self._rows = RowMotion(camera, rotations, config.max_velocity_gap_s)

    def landmarks(self, t_s: float, motion: MotionState, pose: FloatArray) -> ExpectedLandmarks:
        """Return the landmarks that a camera at a pose (4, 4) sees, with their templates: (B) and (C)."""
        views = self._views(pose, self._config.max_landmarks)
        blur = self._blur_px(t_s, motion, views.world_p_landmark)
        templates = render_templates(self._K, pose, views, blur, self._config.template_px)
        shift = self._rows.shifts_px(t_s, motion, pose, views.world_p_landmark)
        return ExpectedLandmarks(views, templates, shift)

    def seen_from(
        self, expected: ExpectedLandmarks, t_s: float, motion: MotionState, pose: FloatArray
    ) -> ExpectedLandmarks:
        """Return the landmarks where the rows of a camera at another pose (4, 4) show them."""
        shift = self._rows.shifts_px(t_s, motion, pose, expected.views.world_p_landmark)
        return replace(expected, shift_px=shift)

    def at_middle_row(self, motion: MotionState, uv_px: FloatArray) -> FloatArray:
        """Return pixels (N, 2) as the middle row's orientation shows them; see :class:`RowMotion`."""
        return self._rows.at_middle_row(motion, uv_px)

    def radius_px(
        self, t_s: float, motion: MotionState, pose: FloatArray, views: LandmarkViews
    ) -> FloatArray:
        """Return half sides (N,) of the search windows around a pose (4, 4), Eq. (6)."""
        config = self._config
        if config.window == "fixed":
            return np.full(len(views), float(config.fixed_window_px))
        speed = config.max_speed_m_s if motion.world_v_camera is None else config.speed_error_m_s
        gyro = self._rotations.covers(motion.t_s, t_s)
        slack = config.rotation_error_px if gyro else config.no_gyro_error_px
        depth = np.maximum(project(self._K, pose, views.world_p_landmark)[1], 1.0)
        return search_radius_px(self._K[0, 0], depth, speed, t_s - motion.t_s, slack)

    def _blur_px(self, t_s: float, motion: MotionState, points: FloatArray) -> FloatArray:
        """Return the image motion (N, 2) during the exposure, (C)."""
        config, dt = self._config, t_s - motion.t_s
        if config.blur == "none" or self._exposure_s == 0:
            return np.zeros((len(points), 2))
        if config.blur == "interval" and dt > 0:
            predicted = predict_pose(motion, self._rotations, t_s)
            share = self._exposure_s / dt
            blur = interval_motion_px(self._K, motion.world_T_camera, predicted, share, points)
        else:
            blur = exposure_motion_px(self._K, motion, self._rotations, t_s, self._exposure_s, points)
        length = np.linalg.norm(blur, axis=1, keepdims=True)
        return np.asarray(blur * np.minimum(1.0, config.max_blur_px / np.maximum(length, 1e-9)))

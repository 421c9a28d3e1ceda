"""The tracker of Matsuda 2007: predict by gyro, choose landmarks, re-blur, match, pose; starts by itself."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import project
from vgps.landmarks.model import LandmarkViews
from vgps.landmarks.view_selection import spread_over_image
from vgps.localization.pose import PoseEstimate
from vgps.localization.prediction import (
    MotionState,
    RotationPredictor,
    exposure_motion_px,
    interval_motion_px,
    predict,
    search_radius_px,
)
from vgps.localization.search import (
    NO_MATCHES,
    ExpectedLandmarks,
    LandmarkMatches,
    SearchResult,
    search_frame,
)
from vgps.localization.template_rendering import render_templates
from vgps.model import Float32Array, FloatArray

ViewSource = Callable[[FloatArray, int], LandmarkViews]
"""Views that suit a pose (4, 4): of each landmark one, the best first, and at most so many."""


@dataclass(frozen=True)
class TrackedFrame:
    """What became of a frame.

    Attributes:
        t_s: Its time.
        world_T_camera: (4, 4); merely predicted if it is not ``tracked``, NaN if not even that.
        covariance: (6, 6) in the camera's tangent; NaN if it is not ``tracked``.
        tracked: Posed by landmarks seen in it.
        recovered: Posed by descriptors, without a prediction.
        observations: The landmarks that agree with the pose.
        correlation: Median over these.
    """

    t_s: float
    world_T_camera: FloatArray
    covariance: FloatArray
    tracked: bool
    recovered: bool
    observations: LandmarkMatches
    correlation: float


class Estimator(Protocol):
    """(E): turns what was found in a frame into its pose, and knows the motion for the next prediction."""

    @property
    def motion(self) -> MotionState | None:
        """What is known of the camera at the last tracked frame; None before the first."""
        ...

    def add(self, t_s: float, pose: PoseEstimate, seen: LandmarkMatches, *, anew: bool) -> PoseEstimate:
        """Take a frame in, which follows the last one or begins ``anew``; its final pose."""
        ...


class Recovery(Protocol):
    """Finds the camera without a prediction."""

    def candidates(self, image: Float32Array) -> list[FloatArray]:
        """Poses (4, 4) worth a search around them, most likely first."""
        ...


class LandmarkTracker:
    """Follows a camera against landmarks.

    Args:
        K: (3, 3) of the undistorted video.
        views: The database's best views for a pose.
        rotations: The gyro between frames, or what stands for it.
        estimator: (E).
        recovery: Start without a pose.
        exposure_s: Of a frame; 0 if it is not known, then nothing is blurred.
        config: Settings.
    """

    def __init__(
        self,
        K: FloatArray,
        views: ViewSource,
        rotations: RotationPredictor,
        estimator: Estimator,
        recovery: Recovery,
        exposure_s: float,
        config: LocalizationConfig,
    ) -> None:
        self._K, self._views, self._rotations = K, views, rotations
        self._estimator, self._recovery = estimator, recovery
        self._exposure_s, self._config = exposure_s, config
        self._recover_from_s = -np.inf

    def add(self, t_s: float, image: Float32Array) -> TrackedFrame:
        """Track the next frame.

        Args:
            t_s: Its time, later than the last one's.
            image: (H, W) undistorted grey.
        """
        motion = self._estimator.motion
        if motion is not None and t_s - motion.t_s <= self._config.coast_s:
            for widen in (1.0, self._config.retry_widening):
                found = self._follow(t_s, image, motion, widen)
                if found.pose is not None:
                    return self._accept(t_s, found.pose, found, anew=False)
        found = SearchResult(None, NO_MATCHES, 0.0)
        if t_s >= self._recover_from_s:
            found = self._recover(t_s, image)
            self._recover_from_s = t_s + self._config.recovery_pause_s
        if found.pose is not None:
            return self._accept(t_s, found.pose, found, anew=True)
        nowhere = np.full((4, 4), np.nan)
        pose = nowhere if motion is None else predict(motion, self._rotations, t_s)
        unknown = np.full((6, 6), np.nan)
        return TrackedFrame(t_s, pose, unknown, False, False, NO_MATCHES, found.correlation)

    def _accept(self, t_s: float, pose: PoseEstimate, found: SearchResult, *, anew: bool) -> TrackedFrame:
        self._recover_from_s = -np.inf
        final = self._estimator.add(t_s, pose, found.observations, anew=anew)
        seen = found.observations.take(final.inlier)
        return TrackedFrame(t_s, final.world_T_camera, final.covariance, True, anew, seen, found.correlation)

    def _follow(self, t_s: float, image: Float32Array, motion: MotionState, widen: float) -> SearchResult:
        """Search for a few around the prediction, Eq. (6), then for all around the pose that these give."""
        config, dt = self._config, t_s - motion.t_s
        predicted = predict(motion, self._rotations, t_s)
        start = predicted if config.select == "prediction" else motion.world_T_camera
        expected = first = self._expect(t_s, motion, start)
        if widen == 1.0:
            uv, _ = project(self._K, start, expected.views.world_p_landmark)
            first = expected.take(spread_over_image(uv.T, image.shape[::-1], config.first_landmarks))
        radius = widen * self._radius(motion, start, first.views, dt)
        found = self._search(image, start, first, radius)
        if found.pose is None or not self._plausible(found.pose.world_T_camera, predicted, dt, widen):
            return SearchResult(None, NO_MATCHES, found.correlation)
        return self._closer(image, found, expected)

    def _recover(self, t_s: float, image: Float32Array) -> SearchResult:
        """Search around the places where the database has seen such an image."""
        before = self._estimator.motion
        bias = np.zeros(3) if before is None else before.gyro_bias_rad_s
        for pose in self._recovery.candidates(image):
            motion = MotionState(t_s, pose, None, np.zeros(3), bias)
            expected = self._expect(t_s, motion, pose)
            radius = np.full(len(expected.views), float(self._config.recovery_window_px))
            found = self._search(image, pose, expected, radius)
            if found.pose is not None:
                return self._closer(image, found, self._expect(t_s, motion, found.pose.world_T_camera))
        return SearchResult(None, NO_MATCHES, 0.0)

    def _closer(self, image: Float32Array, found: SearchResult, expected: ExpectedLandmarks) -> SearchResult:
        """Search again around the pose found, in small windows: more matches, fewer of them false."""
        assert found.pose is not None
        radius = np.full(len(expected.views), float(self._config.refine_window_px))
        again = self._search(image, found.pose.world_T_camera, expected, radius)
        better = again.pose is not None and len(again.observations) >= len(found.observations)
        return again if better else found

    def _search(
        self, image: Float32Array, start: FloatArray, expected: ExpectedLandmarks, radius: FloatArray
    ) -> SearchResult:
        radius = np.minimum(radius, self._config.max_window_px)
        return search_frame(image, self._K, start, expected, radius, self._config)

    def _expect(self, t_s: float, motion: MotionState, start: FloatArray) -> ExpectedLandmarks:
        """The landmarks that a pose sees, and how: (B) and (C)."""
        views = self._views(start, self._config.max_landmarks)
        blur = self._blur(t_s, motion, start, views.world_p_landmark)
        return ExpectedLandmarks(
            views, render_templates(self._K, start, views, blur, self._config.template_px)
        )

    def _radius(self, motion: MotionState, start: FloatArray, views: LandmarkViews, dt: float) -> FloatArray:
        config = self._config
        if config.window == "fixed":
            return np.full(len(views), float(config.fixed_window_px))
        speed = config.max_speed_m_s if motion.world_v_camera is None else config.speed_error_m_s
        gyro = self._rotations.covers(motion.t_s, motion.t_s + dt)
        slack = config.rotation_error_px if gyro else config.no_gyro_error_px
        depth = np.maximum(project(self._K, start, views.world_p_landmark)[1], 1.0)
        return search_radius_px(self._K[0, 0], depth, speed, dt, slack)

    def _blur(self, t_s: float, motion: MotionState, start: FloatArray, points: FloatArray) -> FloatArray:
        """(N, 2) image motion while the shutter is open, (C)."""
        config, dt = self._config, t_s - motion.t_s
        if config.blur == "none" or self._exposure_s == 0:
            return np.zeros((len(points), 2))
        if config.blur == "interval" and dt > 0:
            predicted = predict(motion, self._rotations, t_s)
            share = self._exposure_s / dt
            blur = interval_motion_px(self._K, motion.world_T_camera, predicted, share, points)
        else:
            blur = exposure_motion_px(self._K, motion, self._rotations, t_s, self._exposure_s, points)
        length = np.linalg.norm(blur, axis=1, keepdims=True)
        return np.asarray(blur * np.minimum(1.0, config.max_blur_px / np.maximum(length, 1e-9)))

    def _plausible(self, pose: FloatArray, predicted: FloatArray, dt: float, widen: float) -> bool:
        """Whether a pose is one that the camera can have reached."""
        config = self._config
        cosine = (np.trace(pose[:3, :3].T @ predicted[:3, :3]) - 1) / 2
        turn_deg = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        away_m = float(np.linalg.norm(pose[:3, 3] - predicted[:3, 3]))
        return (
            turn_deg <= config.max_rotation_error_deg * widen and away_m <= config.max_speed_m_s * dt * widen
        )

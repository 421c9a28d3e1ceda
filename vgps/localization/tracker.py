"""The tracker of Matsuda 2007: predict, select landmarks, re-blur, match, estimate; relocalise if lost."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import project
from vgps.landmarks.view_selection import spread_over_image
from vgps.localization.landmark_predictor import LandmarkPredictor
from vgps.localization.pose import NO_MATCHES, LandmarkMatches, PoseEstimate
from vgps.localization.prediction import MotionState, RotationPredictor, predict_pose
from vgps.localization.row_motion import AtMiddleRow
from vgps.localization.search import ExpectedLandmarks, SearchResult, search_frame
from vgps.model import Float32Array, FloatArray


@dataclass(frozen=True, kw_only=True)
class TrackedFrame:
    """Result of one frame.

    Attributes:
        t_s: Its time.
        world_T_camera: (4, 4); predicted if the frame is not tracked, NaN without a prediction.
        covariance: (6, 6) in the camera's tangent space; NaN if the frame is not tracked.
        tracked: Whether landmarks gave the pose.
        recovered: Whether the pose began with descriptors, without a prediction.
        observations: The matches that agree with the pose.
        correlation: Median over the landmarks searched.
    """

    t_s: float
    world_T_camera: FloatArray
    covariance: FloatArray
    tracked: bool
    recovered: bool
    observations: LandmarkMatches
    correlation: float


class Estimator(Protocol):
    """(E): combines the pose of each frame with those before, and keeps the state for the next prediction."""

    @property
    def motion(self) -> MotionState | None:
        """State at the last tracked frame; None before the first."""
        ...

    def add(self, t_s: float, pose: PoseEstimate, matches: LandmarkMatches, *, restart: bool) -> PoseEstimate:
        """Add a frame, which follows the last one or is a restart, and return its final pose."""
        ...


class Recovery(Protocol):
    """Interface of relocalisation without a prediction."""

    def candidates(self, image: Float32Array, at_middle_row: AtMiddleRow) -> list[FloatArray]:
        """Return poses (4, 4) worth a search around them in an image (H, W), most likely first."""
        ...


class LandmarkTracker:
    """Tracks a camera against landmarks, frame by frame.

    Args:
        K: (3, 3) of the undistorted video.
        predictor: Of the landmarks in a frame.
        rotations: Of the camera between frames.
        estimator: (E).
        recovery: Relocalisation.
        config: Settings.
    """

    def __init__(
        self,
        K: FloatArray,
        predictor: LandmarkPredictor,
        rotations: RotationPredictor,
        estimator: Estimator,
        recovery: Recovery,
        config: LocalizationConfig,
    ) -> None:
        self._K, self._predictor, self._rotations = K, predictor, rotations
        self._estimator, self._recovery, self._config = estimator, recovery, config
        self._recover_from_s = -np.inf

    def add(self, t_s: float, image: Float32Array) -> TrackedFrame:
        """Track the next frame.

        Args:
            t_s: Its time, later than the last one's.
            image: (H, W) undistorted grey.
        """
        motion = self._estimator.motion
        if motion is not None and t_s - motion.t_s <= self._config.coast_s:
            for state, widen in self._attempts(motion):
                result = self._follow(t_s, image, state, widen)
                if result.pose is not None:
                    return self._accept(t_s, result.pose, result, restart=False)
        result = SearchResult(None, NO_MATCHES, 0.0)
        if t_s >= self._recover_from_s:
            result = self._recover(t_s, image)
            self._recover_from_s = t_s + self._config.recovery_pause_s
        if result.pose is not None:
            return self._accept(t_s, result.pose, result, restart=True)
        unknown = np.full((4, 4), np.nan)
        return TrackedFrame(
            t_s=t_s,
            world_T_camera=unknown if motion is None else predict_pose(motion, self._rotations, t_s),
            covariance=np.full((6, 6), np.nan),
            tracked=False,
            recovered=False,
            observations=NO_MATCHES,
            correlation=result.correlation,
        )

    def _accept(self, t_s: float, pose: PoseEstimate, result: SearchResult, *, restart: bool) -> TrackedFrame:
        self._recover_from_s = -np.inf
        final = self._estimator.add(t_s, pose, result.matches, restart=restart)
        return TrackedFrame(
            t_s=t_s,
            world_T_camera=final.world_T_camera,
            covariance=final.covariance,
            tracked=True,
            recovered=restart,
            observations=result.matches.take(final.inlier),
            correlation=result.correlation,
        )

    def _attempts(self, motion: MotionState) -> Iterator[tuple[MotionState, float]]:
        """Yield states to follow from and the widening of their windows, until a search succeeds.

        A velocity beyond ``max_speed_m_s`` may come from a false pose, so the frame is also searched without
        it. While the velocity is unknown the last attempt is widened once more, for fast cameras.
        """
        widening = self._config.retry_widening
        yield motion, 1.0
        yield motion, widening
        if motion.world_v_camera is not None:
            if np.linalg.norm(motion.world_v_camera) <= self._config.max_speed_m_s:
                return
            motion = replace(motion, world_v_camera=None)
            yield motion, 1.0
            yield motion, widening
        yield motion, widening**2

    def _follow(self, t_s: float, image: Float32Array, motion: MotionState, widen: float) -> SearchResult:
        """Search for a few landmarks around the prediction, Eq. (6), then for all around the pose found."""
        predicted = predict_pose(motion, self._rotations, t_s)
        start = predicted if self._config.select == "prediction" else motion.world_T_camera
        expected = first = self._predictor.landmarks(t_s, motion, start)
        if widen == 1.0:
            uv, _ = project(self._K, start, expected.views.world_p_landmark)
            first = expected.take(spread_over_image(uv.T, image.shape[::-1], self._config.first_landmarks))
        radius = widen * self._predictor.radius_px(t_s, motion, start, first.views)
        result = self._search(image, start, first, radius, max(1.0, widen / self._config.retry_widening))
        if result.pose is None or not self._plausible(
            result.pose.world_T_camera, predicted, t_s - motion.t_s, widen
        ):
            return SearchResult(None, NO_MATCHES, result.correlation)
        expected = self._predictor.seen_from(expected, t_s, motion, result.pose.world_T_camera)
        return self._search_closely(image, result, expected)

    def _recover(self, t_s: float, image: Float32Array) -> SearchResult:
        """Search around the poses that descriptors suggest."""
        before = self._estimator.motion
        bias = np.zeros(3) if before is None else before.gyro_bias_rad_s
        motion = MotionState(t_s=t_s, world_T_camera=np.eye(4), gyro_bias_rad_s=bias)
        for pose in self._recovery.candidates(image, partial(self._predictor.at_middle_row, motion)):
            motion = replace(motion, world_T_camera=pose)
            expected = self._predictor.landmarks(t_s, motion, pose)
            radius = np.full(len(expected.views), float(self._config.recovery_window_px))
            result = self._search(image, pose, expected, radius)
            if result.pose is not None:
                expected = self._predictor.landmarks(t_s, motion, result.pose.world_T_camera)
                return self._search_closely(image, result, expected)
        return SearchResult(None, NO_MATCHES, 0.0)

    def _search_closely(
        self, image: Float32Array, result: SearchResult, expected: ExpectedLandmarks
    ) -> SearchResult:
        """Search again in small windows around the pose found: more matches, and fewer false ones."""
        assert result.pose is not None
        radius = np.full(len(expected.views), float(self._config.refine_window_px))
        closer = self._search(image, result.pose.world_T_camera, expected, radius)
        better = closer.pose is not None and len(closer.matches) >= len(result.matches)
        return closer if better else result

    def _search(
        self,
        image: Float32Array,
        pose: FloatArray,
        expected: ExpectedLandmarks,
        radius: FloatArray,
        limit_scale: float = 1.0,
    ) -> SearchResult:
        radius = np.minimum(radius, limit_scale * self._config.max_window_px)
        return search_frame(image, self._K, pose, expected, radius, self._config)

    def _plausible(self, pose: FloatArray, predicted: FloatArray, dt: float, widen: float) -> bool:
        """Return whether the camera can have reached a pose."""
        config = self._config
        cosine = (np.trace(pose[:3, :3].T @ predicted[:3, :3]) - 1) / 2
        rotation_deg = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        distance_m = float(np.linalg.norm(pose[:3, 3] - predicted[:3, 3]))
        # only the speed of the camera may be far from its prediction
        if rotation_deg > config.max_rotation_error_deg * min(widen, config.retry_widening):
            return False
        return distance_m <= config.max_speed_m_s * dt * widen

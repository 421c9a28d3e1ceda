"""Stage A, Kume 2010: where the followed features are in a new frame, and the camera's pose from them."""

from dataclasses import dataclass

import numpy as np

from vgps.camera import distort, undistort
from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import project, rays, reprojection_inliers
from vgps.mapping.local_map import LocalMap
from vgps.model import BoolArray, Camera, FloatArray, GrayImage
from vgps.tracking.matching import Match, Matcher, make_matcher
from vgps.tracking.pose import lmeds_pose, refine_pose

_NEAR = 1e-3
_GUESS_STEPS = 4  # of a pose that competes with others, and is refined if it wins


@dataclass(frozen=True)
class TrackingResult:
    """One frame's outcome: observations (N, 2) of the map's followed features, and the pose if there is one.

    ``pose_sigma`` (6,) [rotation rad; translation], of the pose against the features it was computed from.
    """

    raw_uv_px: FloatArray
    uv_px: FloatArray
    found: BoolArray
    world_T_camera: FloatArray | None = None
    pose_sigma: FloatArray | None = None


class FrameTracker:
    """Stage A for one camera."""

    def __init__(
        self, camera: Camera, tracking: TrackingConfig, mapping: MappingConfig, rng: np.random.Generator
    ) -> None:
        self._camera, self._K = camera, camera.K
        self._config, self._mapping = tracking, mapping
        self._rng = rng
        self._matcher: Matcher = make_matcher(tracking)

    def follow(self, local_map: LocalMap, previous: GrayImage, gray: GrayImage) -> TrackingResult:
        """Match alone, for a map that has no positions yet."""
        match = self._matcher.match(previous, gray, local_map.raw_uv_px, local_map.raw_uv_px)
        return self._tracked(match)

    def track(
        self, local_map: LocalMap, previous: GrayImage, gray: GrayImage, predicted: FloatArray
    ) -> TrackingResult:
        """Match, then pose (A-2) to (A-5).

        Args:
            local_map: Features seen in ``previous``, some of them with positions.
            previous: The frame of the map's newest view.
            gray: The new frame.
            predicted: (4, 4) pose by the motion model.

        Returns:
            The outcome; without a pose if the frame is lost.
        """
        uv_guess = self._predict(local_map, predicted)
        match = self._matcher.match(previous, gray, local_map.raw_uv_px, uv_guess)
        tracked = self._tracked(match)
        usable = local_map.positioned & tracked.found
        if usable.sum() < self._config.min_inliers:
            return tracked
        points, uv = local_map.points[local_map.ids[usable]], tracked.uv_px[usable]
        by_motion, _ = refine_pose(
            self._K, predicted, points, uv, np.ones(len(points)), iterations=_GUESS_STEPS
        )
        guesses = np.array([by_motion, predicted, local_map.pose(int(local_map.view_frames[-1]))])
        samples, good_px = self._config.lmeds_samples, 0.4 * self._config.inlier_px
        tentative, _ = lmeds_pose(self._K, points, uv, guesses, samples, self._rng, good_px)
        tentative, _ = self._refine(local_map, tracked, usable, tentative)
        tracked = self._rematch(local_map, previous, gray, tracked, tentative)
        return self._final_pose(local_map, tracked, tentative)

    def _tracked(self, match: Match) -> TrackingResult:
        uv = undistort(self._camera, match.uv_px)
        # beyond the fold of its polynomial a lens has no ray
        seen = np.asarray(np.isfinite(uv).all(axis=1))
        return TrackingResult(match.uv_px, np.where(seen[:, None], uv, 0.0), match.found & seen)

    def _predict(self, local_map: LocalMap, predicted: FloatArray) -> FloatArray:
        """Where to look (N, 2), in the distorted image; features without position at the typical depth."""
        newest = local_map.pose(int(local_map.view_frames[-1]))
        points = local_map.points[local_map.ids]
        positioned = local_map.positioned
        depths = (points[positioned] - newest[:3, 3]) @ newest[:3, 2]
        depth = float(np.median(depths)) if len(depths) else 1.0
        ahead = newest[:3, 3] + depth * rays(self._K, local_map.last_uv_px) @ newest[:3, :3].T
        uv, z = project(self._K, predicted, np.where(positioned[:, None], points, ahead))
        raw = distort(self._camera, uv)
        size = (self._camera.width, self._camera.height)
        sane = (z > _NEAR) & np.all(np.isfinite(raw) & (raw > 0) & (raw < size), axis=1)
        return np.where(sane[:, None], raw, local_map.raw_uv_px)

    def _refine(
        self, local_map: LocalMap, tracked: TrackingResult, usable: BoolArray, start: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        points = local_map.points[local_map.ids]
        usable = usable & reprojection_inliers(
            self._K, start, points, tracked.uv_px, 3.0 * self._config.inlier_px
        )
        sigma = np.nan_to_num(local_map.sigma_px[local_map.ids[usable]], nan=self._mapping.sigma_floor_px)
        mu = 0.5 / np.maximum(sigma, self._mapping.sigma_floor_px) ** 2
        return refine_pose(self._K, start, points[usable], tracked.uv_px[usable], mu)

    def _rematch(
        self,
        local_map: LocalMap,
        previous: GrayImage,
        gray: GrayImage,
        tracked: TrackingResult,
        tentative: FloatArray,
    ) -> TrackingResult:
        """(A-4): features that were missed or mismatched are looked for near where the pose puts them."""
        points = local_map.points[local_map.ids]
        agree = reprojection_inliers(self._K, tentative, points, tracked.uv_px, self._config.inlier_px)
        again = np.flatnonzero(local_map.positioned & ~(tracked.found & agree))
        uv, depth = project(self._K, tentative, points[again])
        raw = distort(self._camera, uv)
        size = (self._camera.width, self._camera.height)
        inside = (depth > _NEAR) & np.all((raw > 0) & (raw < size), axis=1)
        again, raw = again[inside], raw[inside]
        match = self._matcher.rematch(previous, gray, local_map.raw_uv_px[again], raw)
        raw_uv, uv_px, found = tracked.raw_uv_px.copy(), tracked.uv_px.copy(), tracked.found.copy()
        raw_uv[again] = match.uv_px
        again_uv = undistort(self._camera, match.uv_px)
        seen = np.asarray(np.isfinite(again_uv).all(axis=1))
        uv_px[again], found[again] = np.where(seen[:, None], again_uv, 0.0), match.found & seen
        return TrackingResult(raw_uv, uv_px, found)

    def _final_pose(
        self, local_map: LocalMap, tracked: TrackingResult, tentative: FloatArray
    ) -> TrackingResult:
        """(A-5) by Eq. (18); matches that still disagree are dropped."""
        positioned = local_map.positioned
        usable = positioned & tracked.found
        points = local_map.points[local_map.ids]
        pose, information = self._refine(local_map, tracked, usable, tentative)
        agree = reprojection_inliers(self._K, pose, points, tracked.uv_px, self._config.inlier_px)
        inliers = int((usable & agree).sum())
        found = tracked.found & (agree | ~positioned)
        if inliers < self._config.min_inliers or inliers < self._config.min_inlier_share * usable.sum():
            return TrackingResult(tracked.raw_uv_px, tracked.uv_px, tracked.found)
        sigma = np.sqrt(np.diag(np.linalg.pinv(information)))
        return TrackingResult(tracked.raw_uv_px, tracked.uv_px, found, pose, sigma)

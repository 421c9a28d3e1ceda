"""Find a lost camera again: the features of the last good frame, by descriptor, in a later frame."""

import cv2
import numpy as np

from vgps.camera import undistort
from vgps.config import TrackingConfig
from vgps.geometry import reprojection_inliers
from vgps.mapping.local_map import LocalMap
from vgps.model import Camera, FloatArray, GrayImage
from vgps.tracking.pose import lmeds_pose

_RATIO = 0.8  # Lowe's test between the best and the second best match
_SCALE_PX = 12.0
_MAX_FEATURES = 1500


class Relocaliser:
    """Remembers what the last good frame looked like; asked only while tracking is lost."""

    def __init__(
        self, camera: Camera, config: TrackingConfig, rng: np.random.Generator, key: GrayImage, seen: LocalMap
    ) -> None:
        self._camera, self._config, self._rng = camera, config, rng
        self._sift = cv2.SIFT.create(nfeatures=_MAX_FEATURES)
        rows = np.flatnonzero(seen.positioned)
        keypoints = [
            cv2.KeyPoint(float(u), float(v), _SCALE_PX, -1, 0, 0, int(row))
            for row, (u, v) in zip(rows, seen.raw_uv_px[rows], strict=True)
        ]
        kept, descriptors = self._sift.compute(key, keypoints)
        self._descriptors = descriptors
        self._points = seen.points[seen.ids[[keypoint.class_id for keypoint in kept]]]

    def find(self, gray: GrayImage, guess: FloatArray) -> FloatArray | None:
        """Pose (4, 4) of the camera that took ``gray``, or nothing if it sees none of the remembered.

        Args:
            gray: The frame.
            guess: (4, 4) pose by the motion model, a candidate like any other.
        """
        keypoints, descriptors = self._sift.detectAndCompute(gray, None)
        if descriptors is None or self._descriptors is None or len(keypoints) < 2:
            return None
        pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(self._descriptors, descriptors, k=2)
        good = [best for best, second in pairs if best.distance < _RATIO * second.distance]
        if len(good) < self._config.min_inliers:
            return None
        points = self._points[[match.queryIdx for match in good]]
        raw = np.array([keypoints[match.trainIdx].pt for match in good])
        uv = undistort(self._camera, raw)
        seen = np.isfinite(uv).all(axis=1)
        points, uv = points[seen], uv[seen]
        if len(points) < self._config.min_inliers:
            return None
        pose, _ = lmeds_pose(
            self._camera.K, points, uv, guess[None], 5 * self._config.lmeds_samples, self._rng
        )
        agree = reprojection_inliers(self._camera.K, pose, points, uv, 2 * self._config.inlier_px)
        return pose if agree.sum() >= self._config.min_inliers else None

"""Relocalisation: the pose of a lost camera by descriptors of the features of its last good view."""

import cv2
import numpy as np

from vgps.camera import undistort
from vgps.config import TrackingConfig
from vgps.mapping.local_map import LocalMap
from vgps.model import Camera, FloatArray, GrayImage
from vgps.tracking.pose import Correspondences, lmeds_pose

_SCALE_PX = 12.0  # of the descriptors of tracked features, which have no scale of their own


class Relocaliser:
    """Poses frames by the features of a map's newest view, whose image is ``view_image``."""

    def __init__(
        self,
        camera: Camera,
        config: TrackingConfig,
        rng: np.random.Generator,
        view_image: GrayImage,
        local_map: LocalMap,
    ) -> None:
        self._camera, self._config, self._rng = camera, config, rng
        self._sift = cv2.SIFT.create(nfeatures=config.recovery_features)
        rows = np.flatnonzero(local_map.positioned)
        keypoints = [
            cv2.KeyPoint(float(u), float(v), _SCALE_PX, -1, 0, 0, int(row))
            for row, (u, v) in zip(rows, local_map.raw_uv_px[rows], strict=True)
        ]
        kept, self._descriptors = self._sift.compute(view_image, keypoints)
        self._points = local_map.points[local_map.ids[[keypoint.class_id for keypoint in kept]]]

    def locate(self, gray: GrayImage, predicted: FloatArray) -> FloatArray | None:
        """Return the pose (4, 4) of a frame, or None if it shows too few of the features.

        Args:
            gray: The frame.
            predicted: (4, 4) pose by the motion model, a candidate like any other.
        """
        matches = self._match(gray)
        if len(matches) < self._config.min_inliers:
            return None
        K, samples = self._camera.K, 5 * self._config.lmeds_samples
        pose = lmeds_pose(K, matches, predicted[None], samples, self._rng)
        inliers = matches.inliers(K, pose, 2 * self._config.inlier_px)
        return pose if inliers.sum() >= self._config.min_inliers else None

    def _match(self, gray: GrayImage) -> Correspondences:
        """Return the features that pass the ratio test, and where a frame shows them."""
        keypoints, descriptors = self._sift.detectAndCompute(gray, None)
        if descriptors is None or self._descriptors is None or len(keypoints) < 2:
            return Correspondences(np.zeros((0, 3)), np.zeros((0, 2)))
        pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(self._descriptors, descriptors, k=2)
        good = [
            best for best, second in pairs if best.distance < self._config.recovery_ratio * second.distance
        ]
        raw = np.array([keypoints[match.trainIdx].pt for match in good]).reshape(-1, 2)
        uv = undistort(self._camera, raw)
        points = self._points[[match.queryIdx for match in good]]
        return Correspondences(points, uv).where(np.asarray(np.isfinite(uv).all(axis=1)))

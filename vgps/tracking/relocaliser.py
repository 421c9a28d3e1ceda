"""Relocalisation: the pose of a lost camera by descriptors of the features of its last good view."""

import cv2
import numpy as np

from vgps.camera import undistort
from vgps.config import TrackingConfig
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.model import Camera, Float32Array, FloatArray, GrayImage, IntArray
from vgps.tracking.corners import new_corners
from vgps.tracking.pose import Correspondences, lmeds_pose

_RATIO = 0.8  # Lowe's test between the best and the second best match
_SCALE_PX = 12.0
_MAX_CORNERS = 2000


class Relocaliser:
    """Relocaliser by the features of a map's newest view, whose image is ``view_image``."""

    def __init__(
        self,
        camera: Camera,
        config: TrackingConfig,
        rng: np.random.Generator,
        view_image: GrayImage,
        local_map: LocalMap,
    ) -> None:
        self._camera, self._config, self._rng = camera, config, rng
        rows = np.flatnonzero(local_map.positioned)
        kept, self._descriptors = _describe(view_image, local_map.raw_uv_px[rows])
        self._points = local_map.points[local_map.ids[rows[kept]]]

    def locate(self, gray: GrayImage, predicted: FloatArray) -> FloatArray | None:
        """Return the pose (4, 4) of a frame, or None if it shows too few of the features.

        Args:
            gray: The frame.
            predicted: (4, 4) pose by the motion model, which competes with the sampled poses.
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
        corners = new_corners(gray, np.zeros((0, 2)), _MAX_CORNERS, self._config, self._rng)
        kept, descriptors = _describe(gray, corners)
        if len(self._descriptors) == 0 or len(descriptors) < 2:
            return Correspondences(np.zeros((0, 3)), np.zeros((0, 2)))
        pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(self._descriptors, descriptors, k=2)
        good = [best for best, second in pairs if best.distance < _RATIO * second.distance]
        uv = undistort(self._camera, corners[kept[[match.trainIdx for match in good]]])
        points = self._points[[match.queryIdx for match in good]]
        matches = Correspondences(points, uv, lens_jacobian(self._camera, uv))
        return matches.where(np.asarray(np.isfinite(uv).all(axis=1)))


def _describe(gray: GrayImage, raw_uv_px: FloatArray) -> tuple[IntArray, Float32Array]:
    """Return SIFT descriptors (n, 128) of pixels, all of one scale and upright, and the rows that have one.

    Both images are described alike: an orientation that SIFT detects would match no upright descriptor.
    """
    keypoints = [
        cv2.KeyPoint(float(u), float(v), _SCALE_PX, 0.0, 0.0, 0, row) for row, (u, v) in enumerate(raw_uv_px)
    ]
    kept, descriptors = cv2.SIFT.create().compute(gray, keypoints)
    if descriptors is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 128), dtype=np.float32)
    return np.array([keypoint.class_id for keypoint in kept]), np.asarray(descriptors, np.float32)

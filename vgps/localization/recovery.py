"""A camera without any idea of its pose finds itself by the descriptors of the database's keyframes."""

from collections.abc import Callable, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from vgps.config import LocalizationConfig
from vgps.landmarks.model import Keyframe
from vgps.localization.pose import pose_from_matches
from vgps.model import BoolArray, Float32Array, FloatArray, GrayImage, IntArray

Describe = Callable[[GrayImage, int], tuple[FloatArray, npt.NDArray[np.uint8]]]
"""The strongest so many features of an image: positions (N, 2) and descriptors (N, D)."""

_NEIGHBOURS = 6  # a landmark is in several keyframes; the next other one must be among these


class DescriptorRecovery:
    """Asked only while the camera is lost.

    Args:
        keyframes: Of the database.
        describe: Features of an image, the same that the keyframes hold.
        K: (3, 3).
        config: Settings.
    """

    def __init__(
        self, keyframes: Sequence[Keyframe], describe: Describe, K: FloatArray, config: LocalizationConfig
    ) -> None:
        self._describe, self._K, self._config = describe, K, config
        kept = [keyframe for keyframe in keyframes if len(keyframe.landmark)]
        self._seen = [np.unique(keyframe.landmark) for keyframe in kept]
        self._landmark = np.concatenate([keyframe.landmark for keyframe in kept] or [np.zeros(0, np.int64)])
        self._points = np.concatenate([keyframe.world_p_landmark for keyframe in kept] or [np.zeros((0, 3))])
        self._descriptors = np.concatenate([keyframe.descriptors for keyframe in kept]) if kept else None

    def candidates(self, image: Float32Array) -> list[FloatArray]:
        """Poses (4, 4) that matches with one keyframe's landmarks agree on, best supported first."""
        uv, landmark, points = self._match(image)
        votes = [np.isin(landmark, seen) for seen in self._seen]
        order = np.argsort([-vote.sum() for vote in votes], kind="stable")
        found: list[tuple[int, FloatArray]] = []
        for k in order[: self._config.recovery_keyframes]:
            pose = self._pose(points[votes[k]], uv[votes[k]])
            if pose is not None:
                found.append(pose)
        found.sort(key=lambda supported: -supported[0])
        return [pose for _, pose in found[: self._config.recovery_candidates]]

    def _match(self, image: Float32Array) -> tuple[FloatArray, IntArray, FloatArray]:
        """Features of the image with the one landmark that looks like them."""
        uv, descriptors = self._describe(
            np.clip(image, 0, 255).astype(np.uint8), self._config.recovery_features
        )
        if self._descriptors is None or len(self._descriptors) < _NEIGHBOURS or len(uv) == 0:
            return np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros((0, 3))
        neighbours = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(descriptors, self._descriptors, k=_NEIGHBOURS)
        rows = np.array([[match.trainIdx for match in matches] for matches in neighbours])
        distance = np.array([[match.distance for match in matches] for matches in neighbours])
        good = self._distinct(self._landmark[rows], distance)
        # one feature for a landmark, the most alike: two of them at one point leave a pose undetermined
        order = np.flatnonzero(good)[np.argsort(distance[good, 0], kind="stable")]
        best = rows[order, 0]
        landmark, first = np.unique(self._landmark[best], return_index=True)
        return uv[order[first]], landmark, self._points[best[first]]

    def _distinct(self, landmark: IntArray, distance: FloatArray) -> BoolArray:
        """(N,) Lowe's test of the best neighbour (N, k) against the first that is another landmark."""
        other = np.where(landmark != landmark[:, :1], distance, np.inf).min(axis=1)
        return np.asarray(distance[:, 0] < self._config.recovery_ratio * other)

    def _pose(self, points: FloatArray, uv: FloatArray) -> tuple[int, FloatArray] | None:
        config = self._config
        if len(points) < config.min_inliers:
            return None
        pose = pose_from_matches(self._K, points, uv, np.ones(len(uv)), 2 * config.ransac_px, config)
        if pose is None or pose.inlier.sum() < config.min_inliers:
            return None
        return int(pose.inlier.sum()), pose.world_T_camera

"""Relocalisation of a camera of unknown pose, by the descriptors of the database's keyframes."""

from collections.abc import Sequence

import cv2
import numpy as np

from vgps.config import LocalizationConfig
from vgps.landmarks.descriptors import describe
from vgps.landmarks.model import Keyframe
from vgps.localization.pose import NO_MATCHES, LandmarkMatches, PoseEstimate, pose_from_matches
from vgps.localization.row_motion import AtMiddleRow
from vgps.model import BoolArray, Float32Array, FloatArray, IntArray

_NEIGHBOURS = 6  # several keyframes hold a landmark; the next best other landmark must be among these
_INLIER_SCALE = 2.0  # features lie less precisely than templates


class DescriptorRecovery:
    """Matches a frame's features with those of keyframes.

    Args:
        keyframes: Of the database.
        K: (3, 3).
        config: Settings.
    """

    def __init__(self, keyframes: Sequence[Keyframe], K: FloatArray, config: LocalizationConfig) -> None:
        self._K, self._config = K, config
        usable = [keyframe for keyframe in keyframes if len(keyframe.landmark)]
        self._of_keyframe = [np.unique(keyframe.landmark) for keyframe in usable]
        self._landmark = np.concatenate([keyframe.landmark for keyframe in usable] or [np.zeros(0, np.int64)])
        self._points = np.concatenate(
            [keyframe.world_p_landmark for keyframe in usable] or [np.zeros((0, 3))]
        )
        self._descriptors = np.concatenate([keyframe.descriptors for keyframe in usable]) if usable else None

    def candidates(self, image: Float32Array, at_middle_row: AtMiddleRow) -> list[FloatArray]:
        """Return poses (4, 4) that matches with the landmarks of one keyframe agree on, best supported first.

        Args:
            image: (H, W) undistorted grey.
            at_middle_row: Undoes a rolling shutter.
        """
        matches = self._match(image, at_middle_row)
        votes = [np.isin(matches.landmark, landmarks) for landmarks in self._of_keyframe]
        order = np.argsort([-vote.sum() for vote in votes], kind="stable")
        found: list[PoseEstimate] = []
        for k in order[: self._config.recovery_keyframes]:
            pose = self._pose(matches.take(votes[k]))
            if pose is not None:
                found.append(pose)
        found.sort(key=lambda pose: -int(pose.inlier.sum()))
        return [pose.world_T_camera for pose in found[: self._config.recovery_candidates]]

    def _match(self, image: Float32Array, at_middle_row: AtMiddleRow) -> LandmarkMatches:
        """Match the image's features with landmarks, one feature per landmark."""
        gray = np.clip(image, 0, 255).astype(np.uint8)
        uv, descriptors = describe(gray, self._config.recovery_features)
        if self._descriptors is None or len(self._descriptors) < _NEIGHBOURS or len(uv) == 0:
            return NO_MATCHES
        neighbours = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(descriptors, self._descriptors, k=_NEIGHBOURS)
        rows = np.array([[match.trainIdx for match in matches] for matches in neighbours])
        distance = np.array([[match.distance for match in matches] for matches in neighbours])
        good = self._distinct(self._landmark[rows], distance)
        # only the most similar feature of a landmark: two at one point leave a pose undetermined
        order = np.flatnonzero(good)[np.argsort(distance[good, 0], kind="stable")]
        best = rows[order, 0]
        landmark, first = np.unique(self._landmark[best], return_index=True)
        seen = uv[order[first]]
        middle = at_middle_row(seen)
        return LandmarkMatches(
            landmark=landmark,
            world_p_landmark=self._points[best[first]],
            uv_px=middle,
            sigma_px=np.ones(len(landmark)),
            shift_px=seen - middle,
        )

    def _distinct(self, landmark: IntArray, distance: FloatArray) -> BoolArray:
        """Return Lowe's ratio test (N,): the best neighbour (N, k) against the best of another landmark."""
        other = np.where(landmark != landmark[:, :1], distance, np.inf).min(axis=1)
        return np.asarray(distance[:, 0] < self._config.recovery_ratio * other)

    def _pose(self, matches: LandmarkMatches) -> PoseEstimate | None:
        if len(matches) < self._config.min_inliers:
            return None
        pose = pose_from_matches(self._K, matches, _INLIER_SCALE * self._config.ransac_px, self._config)
        return None if pose is None or pose.inlier.sum() < self._config.min_inliers else pose

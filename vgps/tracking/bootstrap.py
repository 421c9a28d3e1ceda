"""How a map begins: two views, their relative pose, and the poses of the frames between them."""

import cv2
import numpy as np

from vgps.config import StartConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, project, triangulate, world_rays
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.tracking.pose import lmeds_pose, refine_pose

_MAX_ERROR_PX = 1.0


class TwoViewInitializer:
    """Begins a map from its oldest and newest view once they show enough parallax."""

    def __init__(
        self, K: FloatArray, start: StartConfig, tracking: TrackingConfig, rng: np.random.Generator
    ) -> None:
        self._K, self._start, self._tracking, self._rng = K, start, tracking, rng

    def initialize(self, local_map: LocalMap) -> bool:
        """Pose all views of the map if its oldest and newest are far enough apart; say whether it worked.

        The oldest view becomes the origin and the distance to the newest the unit of length.
        """
        columns = np.flatnonzero(local_map.view_frames >= 0)
        oldest, newest = int(columns[0]), int(columns[-1])
        both = np.isfinite(local_map.views[:, oldest, 0])
        if both.sum() < self._start.min_inliers:
            return False
        first, last = local_map.views[both, oldest], local_map.views[both, newest]
        if np.median(np.linalg.norm(last - first, axis=1)) < self._start.min_flow_px:
            return False
        second = self._relative_pose(first, last)
        if second is None:
            return False
        pair = np.stack([np.eye(4), second])
        uv = np.stack([first, last], axis=1).reshape(-1, 2)
        cameras, start = np.tile(pair, (len(first), 1, 1)), 2 * np.arange(len(first))
        points, error = triangulate(self._K, cameras, uv, start)
        good = error.reshape(-1, 2).max(axis=1) < _MAX_ERROR_PX
        angle = largest_angle_rad(world_rays(self._K, cameras, uv), start)
        if good.sum() < self._start.min_inliers:
            return False
        if np.degrees(np.median(angle[good])) < self._start.min_parallax_deg:
            return False
        ids = local_map.ids[both][good]
        local_map.set_points(ids, points[good], np.full(len(ids), self._tracking.inlier_px / 2))
        return self._pose_views(local_map, oldest, newest, second)

    def _relative_pose(self, first: FloatArray, last: FloatArray) -> FloatArray | None:
        """(4, 4) pose of the second view in the first, with a unit baseline, or nothing."""
        essential, mask = cv2.findEssentialMat(
            first, last, self._K, method=cv2.USAC_MAGSAC, prob=0.9999, threshold=_MAX_ERROR_PX
        )
        if essential is None or essential.shape != (3, 3):
            return None
        count, rotation, translation, _ = cv2.recoverPose(essential, first, last, self._K, mask=mask)
        if count < self._start.min_inliers:
            return None
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ translation[:, 0]
        return pose

    def _pose_views(self, local_map: LocalMap, oldest: int, newest: int, second: FloatArray) -> bool:
        """Poses of all views by the points just made, written to the map in order of time."""
        poses = {int(local_map.view_frames[oldest]): np.eye(4), int(local_map.view_frames[newest]): second}
        guess = np.eye(4)
        for column in range(oldest + 1, newest):
            frame = int(local_map.view_frames[column])
            uv = local_map.views[:, column]
            usable = np.isfinite(uv[:, 0]) & local_map.positioned
            if usable.sum() < self._tracking.min_inliers:
                return False
            points, uv = local_map.points[local_map.ids[usable]], uv[usable]
            pose, _ = lmeds_pose(
                self._K, points, uv, np.array([guess, second]), self._tracking.lmeds_samples, self._rng
            )
            predicted, _ = project(self._K, pose, points)
            near = np.linalg.norm(predicted - uv, axis=1) < 2 * self._tracking.inlier_px
            guess, _ = refine_pose(self._K, pose, points[near], uv[near], np.ones(int(near.sum())))
            poses[frame] = guess
        for frame, pose in poses.items():
            local_map.poses[frame - local_map.first_frame] = pose
        return True

"""Start of a map: two views, their relative pose, and the poses of the frames between them."""

import cv2
import numpy as np

from vgps.config import StartConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, project, triangulate, world_rays
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.tracking.pose import lmeds_pose, refine_pose

_MAX_ERROR_PX = 1.0


class TwoViewInitializer:
    """Starts a map from its oldest and newest view once they show enough parallax."""

    def __init__(
        self, K: FloatArray, start: StartConfig, tracking: TrackingConfig, rng: np.random.Generator
    ) -> None:
        self._K, self._start, self._tracking, self._rng = K, start, tracking, rng

    def initialize(self, local_map: LocalMap) -> MapUpdate | None:
        """Return the poses of all views and the first positions, once the views are far enough apart.

        The oldest view becomes the origin and the distance to the newest the unit of length.
        """
        columns = np.flatnonzero(local_map.view_frames >= 0)
        oldest, newest = int(columns[0]), int(columns[-1])
        both = np.flatnonzero(np.isfinite(local_map.views[:, oldest, 0]))
        first, last = local_map.views[both, oldest], local_map.views[both, newest]
        if len(both) < self._start.min_inliers or _median_flow(first, last) < self._start.min_flow_px:
            return None
        second = self._relative_pose(first, last)
        if second is None:
            return None
        points, good = self._triangulate_pair(first, last, second)
        if points is None:
            return None
        rows = both[good]
        poses = self._view_poses(local_map, rows, points, second)
        if poses is None:
            return None
        first_frame, all_poses = local_map.first_frame, local_map.poses.copy()
        for frame, pose in poses.items():
            all_poses[frame - first_frame] = pose
        positions = Positions(local_map.ids[rows], points, np.full(len(rows), self._tracking.inlier_px / 2))
        return MapUpdate(first_frame=first_frame, poses=all_poses, positions=positions)

    def _triangulate_pair(
        self, first: FloatArray, last: FloatArray, second: FloatArray
    ) -> tuple[FloatArray | None, BoolArray]:
        """Return the points that fit both views, and which features (n,) they are; no points if too few
        do."""
        uv = np.stack([first, last], axis=1).reshape(-1, 2)
        cameras, start = np.tile(np.stack([np.eye(4), second]), (len(first), 1, 1)), 2 * np.arange(len(first))
        points, error = triangulate(self._K, cameras, uv, start)
        good = error.reshape(-1, 2).max(axis=1) < _MAX_ERROR_PX
        if good.sum() < self._start.min_inliers:
            return None, good
        angle = largest_angle_rad(world_rays(self._K, cameras, uv), start)
        enough = np.degrees(np.median(angle[good])) >= self._start.min_parallax_deg
        return points[good] if enough else None, good

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

    def _view_poses(
        self, local_map: LocalMap, rows: IntArray, points: FloatArray, second: FloatArray
    ) -> dict[int, FloatArray] | None:
        """Return the pose (4, 4) of every view by frame, from points (n, 3) of the features ``rows`` (n,)."""
        frames = [int(frame) for frame in local_map.view_frames if frame >= 0]
        poses, guess = {frames[0]: np.eye(4), frames[-1]: second}, np.eye(4)
        for column, frame in enumerate(frames[1:-1], start=len(local_map.view_frames) - len(frames) + 1):
            uv = local_map.views[rows, column]
            seen = np.isfinite(uv[:, 0])
            if seen.sum() < self._tracking.min_inliers:
                return None
            uv, visible = uv[seen], points[seen]
            pose, _ = lmeds_pose(
                self._K, visible, uv, np.array([guess, second]), self._tracking.lmeds_samples, self._rng
            )
            predicted, _ = project(self._K, pose, visible)
            near = np.linalg.norm(predicted - uv, axis=1) < 2 * self._tracking.inlier_px
            guess, _ = refine_pose(self._K, pose, visible[near], uv[near], np.ones(int(near.sum())))
            poses[frame] = guess
        return poses


def _median_flow(first: FloatArray, last: FloatArray) -> float:
    return float(np.median(np.linalg.norm(last - first, axis=1)))

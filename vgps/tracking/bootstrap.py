"""Start of a map: the relative pose of two views, first positions, and the poses of the views between."""

import cv2
import numpy as np

from vgps.config import StartConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, project, triangulate, world_rays
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.tracking.pose import Correspondences, lmeds_pose, refine_pose


class TwoViewInitialiser:
    """Initialiser of a map from its oldest and newest view, once they have enough parallax."""

    def __init__(
        self, K: FloatArray, start: StartConfig, tracking: TrackingConfig, rng: np.random.Generator
    ) -> None:
        self._K, self._start, self._tracking, self._rng = K, start, tracking, rng

    def initialise(self, local_map: LocalMap) -> MapUpdate | None:
        """Return the poses of all views and the first positions, or None if two views do not give them yet.

        The oldest view becomes the origin, and its distance to the newest the unit of length.
        """
        columns = np.flatnonzero(local_map.view_frames >= 0)
        oldest, newest = int(columns[0]), int(columns[-1])
        common = np.flatnonzero(np.isfinite(local_map.views[:, oldest, 0]))
        first, last = local_map.views[common, oldest], local_map.views[common, newest]
        if len(common) < self._start.min_inliers or _median_flow(first, last) < self._start.min_flow_px:
            return None
        last_pose = self._relative_pose(first, last)
        if last_pose is None:
            return None
        points, good = self._triangulate_pair(first, last, last_pose)
        if points is None:
            return None
        rows = common[good]
        poses = self._view_poses(local_map, rows, points, last_pose)
        if poses is None:
            return None
        first_frame, all_poses = local_map.first_frame, local_map.poses.copy()
        for frame, pose in poses.items():
            all_poses[frame - first_frame] = pose
        positions = Positions(local_map.ids[rows], points, np.full(len(rows), self._tracking.inlier_px / 2))
        return MapUpdate(first_frame=first_frame, poses=all_poses, positions=positions)

    def _triangulate_pair(
        self, first: FloatArray, last: FloatArray, last_pose: FloatArray
    ) -> tuple[FloatArray | None, BoolArray]:
        """Return the points that fit both views, None if there are too few or the parallax is too small, and
        which features (n,) they are."""
        uv = np.stack([first, last], axis=1).reshape(-1, 2)
        cameras = np.tile(np.stack([np.eye(4), last_pose]), (len(first), 1, 1))
        start = 2 * np.arange(len(first))
        points, error = triangulate(self._K, cameras, uv, start)
        good = error.reshape(-1, 2).max(axis=1) < self._start.max_error_px
        if good.sum() < self._start.min_inliers:
            return None, good
        angle = largest_angle_rad(world_rays(self._K, cameras, uv), start)
        enough = np.degrees(np.median(angle[good])) >= self._start.min_parallax_deg
        return points[good] if enough else None, good

    def _relative_pose(self, first: FloatArray, last: FloatArray) -> FloatArray | None:
        """Return the pose (4, 4) of the last view in the first with a unit baseline, or None."""
        essential, mask = cv2.findEssentialMat(
            first, last, self._K, method=cv2.USAC_MAGSAC, prob=0.9999, threshold=self._start.max_error_px
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
        self, local_map: LocalMap, rows: IntArray, points: FloatArray, last_pose: FloatArray
    ) -> dict[int, FloatArray] | None:
        """Return the pose (4, 4) of every view by frame, from points (n, 3) of the features ``rows`` (n,)."""
        frames = [int(frame) for frame in local_map.view_frames if frame >= 0]
        poses, guess = {frames[0]: np.eye(4), frames[-1]: last_pose}, np.eye(4)
        for column, frame in enumerate(frames[1:-1], start=len(local_map.view_frames) - len(frames) + 1):
            uv = local_map.views[rows, column]
            matches = Correspondences(points, uv).where(np.isfinite(uv[:, 0]))
            if len(matches) < self._tracking.min_inliers:
                return None
            guesses = np.array([guess, last_pose])
            pose = lmeds_pose(self._K, matches, guesses, self._tracking.lmeds_samples, self._rng)
            predicted, _ = project(self._K, pose, matches.points)
            near = np.linalg.norm(predicted - matches.uv_px, axis=1) < 2 * self._tracking.inlier_px
            matches = matches.where(near)
            guess, _ = refine_pose(self._K, pose, matches, np.ones(len(matches)))
            poses[frame] = guess
        return poses


def _median_flow(first: FloatArray, last: FloatArray) -> float:
    return float(np.median(np.linalg.norm(last - first, axis=1)))

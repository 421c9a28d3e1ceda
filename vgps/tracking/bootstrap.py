"""Start of a map: the relative pose of two views, first positions, and the poses of the views between."""

from collections.abc import Mapping

import cv2
import numpy as np

from vgps.camera import distort
from vgps.config import StartConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, triangulate, world_rays
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import BoolArray, Camera, FloatArray, IntArray
from vgps.tracking.pose import Correspondences, lmeds_pose, refine_pose
from vgps.tracking.row_motion import at_middle_rows
from vgps.tracking.static_regions import still

_MIN_ROLLING_VIEWS = 4  # so that two of them have others on either side


class TwoViewInitialiser:
    """Initialiser of a map from its oldest and newest view, once they have enough parallax."""

    def __init__(
        self, camera: Camera, start: StartConfig, tracking: TrackingConfig, rng: np.random.Generator
    ) -> None:
        self._camera, self._K = camera, camera.K
        self._start, self._tracking, self._rng = start, tracking, rng

    def initialise(self, local_map: LocalMap) -> MapUpdate | None:
        """Return the poses of all views and the first positions, or None if two views do not give them yet.

        They are the newest and the oldest that shares enough features with it or, if those do not fit, twice
        as many; under a rolling shutter those next to them, for which no row is extrapolated. The oldest
        becomes the origin, and the distance of the two the unit of length; views before it get no pose.
        """
        frames = local_map.view_frames[local_map.view_frames >= 0]
        # the newest view shows every feature that is followed
        shared = np.isfinite(local_map.views[:, -len(frames) :, 0]).sum(axis=0)
        enough = [shared >= least * self._start.min_inliers for least in (1, 2)]
        oldest = sorted({int(np.argmax(views)) for views in enough if views.any()})
        starts = (self._start_from(local_map, frames[view:]) for view in oldest)
        return next((start for start in starts if start is not None), None)

    def _start_from(self, local_map: LocalMap, frames: IntArray) -> MapUpdate | None:
        """Return the start of a map from the views of the given frames, the newest ones."""
        views = local_map.views[:, -len(frames) :]
        common = np.flatnonzero(np.isfinite(views[:, 0, 0]))
        uv_px, pair = views[common], (0, len(frames) - 1)
        if self._camera.readout_s and len(frames) >= _MIN_ROLLING_VIEWS:
            t_s = local_map.t_s[frames - local_map.first_frame]
            uv_px, pair = at_middle_rows(self._camera, t_s, uv_px), (1, len(frames) - 2)
        first, last = uv_px[:, pair[0]], uv_px[:, pair[1]]
        if len(common) < self._start.min_inliers or self._median_flow(first, last) < self._start.min_flow_px:
            return None
        fitting = self._fits_what_moves(views[common], first, last)
        common, uv_px, first, last = common[fitting], uv_px[fitting], first[fitting], last[fitting]
        last_pose = self._relative_pose(first, last)
        if last_pose is None:
            return None
        points, good = self._triangulate_pair(first, last, last_pose)
        if points is None:
            return None
        known = dict(zip(pair, (np.eye(4), last_pose), strict=True))
        view_poses = self._view_poses(uv_px[good], points, known)
        if view_poses is None:
            return None
        first_T_map = np.linalg.inv(view_poses[0])
        points = points @ first_T_map[:3, :3].T + first_T_map[:3, 3]
        poses = local_map.poses.copy()
        poses[frames - local_map.first_frame] = first_T_map @ view_poses
        ids = local_map.ids[common[good]]
        positions = Positions(ids, points, np.full(len(ids), self._tracking.inlier_px / 2))
        return MapUpdate(first_frame=local_map.first_frame, poses=poses, positions=positions)

    def _fits_what_moves(self, views: FloatArray, first: FloatArray, last: FloatArray) -> BoolArray:
        """Return (n,) which features move in the picture, or stay and fit the pose that the others give.

        Many that never move would be inliers of a camera that does not turn.
        """
        moves = ~still(self._camera, views, self._tracking.forward_backward_px)
        if moves.all():
            return moves
        last_pose = self._relative_pose(first[moves], last[moves])
        if last_pose is None:
            return np.ones_like(moves)
        _, good = self._triangulate_pair(first, last, last_pose)
        return moves | good

    def _triangulate_pair(
        self, first: FloatArray, last: FloatArray, last_pose: FloatArray
    ) -> tuple[FloatArray | None, BoolArray]:
        """Return the points that fit both views, None if there are too few or the parallax is too small, and
        which features (n,) they are."""
        uv = np.stack([first, last], axis=1).reshape(-1, 2)
        cameras = np.tile(np.stack([np.eye(4), last_pose]), (len(first), 1, 1))
        start = 2 * np.arange(len(first))
        points, error = triangulate(self._K, cameras, uv, start, lens=lens_jacobian(self._camera, uv))
        good = error.reshape(-1, 2).max(axis=1) < self._start.max_error_px
        if good.sum() < self._start.min_inliers:
            return None, good
        angle = largest_angle_rad(world_rays(self._K, cameras, uv), start)
        enough = np.degrees(np.median(angle[good])) >= self._start.min_parallax_deg
        return points[good] if enough else None, good

    def _relative_pose(self, first: FloatArray, last: FloatArray) -> FloatArray | None:
        """Return the pose (4, 4) of the last view in the first with a unit baseline, or None."""
        if len(first) < self._start.min_inliers:
            return None
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
        self, uv_px: FloatArray, points: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray | None:
        """Return the pose (V, 4, 4) of every view from points (n, 3) seen there at (n, V, 2).

        Args:
            uv_px: Undistorted pixels, NaN where unknown.
            points: Positions.
            known: Poses of the two views that gave them.
        """
        poses = np.empty((uv_px.shape[1], 4, 4))
        guess, last_pose = known.values()
        for view in range(len(poses)):
            if view in known:
                poses[view] = known[view]
                continue
            matches = Correspondences(points, uv_px[:, view], lens_jacobian(self._camera, uv_px[:, view]))
            matches = matches.where(np.isfinite(uv_px[:, view, 0]))
            if len(matches) < self._tracking.min_inliers:
                return None
            guesses = np.array([guess, last_pose])
            pose = lmeds_pose(self._K, matches, guesses, self._tracking.lmeds_samples, self._rng)
            matches = matches.where(matches.inliers(self._K, pose, 2 * self._tracking.inlier_px))
            guess, _ = refine_pose(self._K, pose, matches, np.ones(len(matches)))
            poses[view] = guess
        return poses

    def _median_flow(self, first: FloatArray, last: FloatArray) -> float:
        """Return how far the median feature moved in the picture."""
        moved = distort(self._camera, last) - distort(self._camera, first)
        return float(np.nanmedian(np.linalg.norm(moved, axis=1)))

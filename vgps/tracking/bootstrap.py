"""Start of a map: the relative pose of two views, first positions, and the poses of the views between."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from vgps.camera import distort
from vgps.config import StartConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, project, triangulate, world_rays
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import BoolArray, Camera, FloatArray, IntArray
from vgps.tracking.planar_motion import poses_over_plane
from vgps.tracking.pose import Correspondences, lmeds_pose, refine_pose
from vgps.tracking.row_motion import at_middle_rows
from vgps.tracking.start_significance import fits_better, shows_motion
from vgps.tracking.static_regions import stays_in_picture

_MIN_ROLLING_VIEWS = 4  # so that two of them have others on either side
_LEAST_OF_HALF = 8  # features that show an essential matrix of their own
_SAME_DIRECTION = 0.9  # cosine of the angle between two motions, above which they are one


@dataclass(frozen=True)
class _TwoViewMap:
    """Positions (m, 3) of some features, which of them (n,), and the poses (V, 4, 4) of all views."""

    points: FloatArray
    good: BoolArray
    view_poses: FloatArray

    def misfit(self, K: FloatArray, uv_px: FloatArray, limit_px: float) -> FloatArray:
        """Return (n,) the mean squared error of features (n, V, 2) [px^2], at the limit for all others."""
        squared = np.full(uv_px.shape[:2], limit_px**2)
        for view, pose in enumerate(self.view_poses):
            projected, depth = project(K, pose, self.points)
            error = np.sum((projected - uv_px[self.good, view]) ** 2, axis=1)
            squared[self.good, view] = np.where(depth > 0.0, np.fmin(error, limit_px**2), limit_px**2)
        return np.asarray(np.mean(squared, axis=1, where=np.isfinite(uv_px[..., 0])))


class TwoViewInitialiser:
    """Initialiser of a map from its oldest and newest view, once they have enough parallax."""

    def __init__(
        self, camera: Camera, start: StartConfig, tracking: TrackingConfig, rng: np.random.Generator
    ) -> None:
        self._camera, self._K = camera, camera.K
        self._start, self._tracking, self._rng = start, tracking, rng

    def initialise(self, local_map: LocalMap) -> MapUpdate | None:
        """Return the poses of all views and the first positions, or None if two views do not give them yet.

        They are the newest and the oldest that shares enough features with it or, if those do not fit, two or
        four times as many; under a rolling shutter those next to them, for which no row is extrapolated. The
        oldest becomes the origin, the distance of the two the unit of length; views before it get no pose.
        """
        frames = local_map.view_frames[local_map.view_frames >= 0]
        # the newest view shows every feature that is followed
        shared = np.isfinite(local_map.views[:, -len(frames) :, 0]).sum(axis=0)
        enough = [shared >= least * self._start.min_inliers for least in (1, 2, 4)]
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
        last_pose = self._relative_pose(first, last, self._start.min_inliers)
        if last_pose is None:
            return None
        found = self._two_view_map(uv_px, pair, last_pose, self._rng)
        if found is None or not shows_motion(first, last, self._directions, self._start.chance_of_start):
            return None
        may_wait = len(frames) < local_map.views.shape[1] and self._start.max_chance < 1.0
        found = self._or_its_planar_twin(found, uv_px, pair, may_wait)
        if found is None:
            return None
        first_T_map = np.linalg.inv(found.view_poses[0])
        points = found.points @ first_T_map[:3, :3].T + first_T_map[:3, 3]
        poses = local_map.poses.copy()
        poses[frames - local_map.first_frame] = first_T_map @ found.view_poses
        ids = local_map.ids[common[found.good]]
        positions = Positions(ids, points, np.full(len(ids), self._tracking.inlier_px / 2))
        return MapUpdate(first_frame=local_map.first_frame, poses=poses, positions=positions)

    def _two_view_map(
        self, uv_px: FloatArray, pair: tuple[int, int], last_pose: FloatArray, rng: np.random.Generator
    ) -> _TwoViewMap | None:
        """Return the map of features (n, V, 2) by the relative pose of a pair of the views, or None."""
        points, good = self._triangulate_pair(uv_px[:, pair[0]], uv_px[:, pair[1]], last_pose)
        if points is None:
            return None
        known = dict(zip(pair, (np.eye(4), last_pose), strict=True))
        view_poses = self._view_poses(uv_px[good], points, known, rng)
        return None if view_poses is None else _TwoViewMap(points, good, view_poses)

    def _or_its_planar_twin(
        self, found: _TwoViewMap, uv_px: FloatArray, pair: tuple[int, int], may_wait: bool
    ) -> _TwoViewMap | None:
        """Return the map, or one of the other motion that two views of a plane allow, if that fits better.

        None if all views together do not show which, and there is time to wait for more.
        """
        first, last = pair
        limit_px = self._start.max_error_px
        direction = found.view_poses[last, :3, 3] - found.view_poses[first, :3, 3]
        rng = np.random.default_rng(0)  # other draws do not depend on whether there is a plane
        fitting = uv_px[found.good]
        others = [
            self._two_view_map(uv_px, pair, pose, rng)
            for pose in poses_over_plane(self._K, fitting[:, first], fitting[:, last], limit_px)
            if pose[:3, 3] @ direction < _SAME_DIRECTION
        ]
        possible = [found, *(other for other in others if other is not None)]
        misfits = [one.misfit(self._K, uv_px, limit_px) for one in possible]
        best = int(np.argmin([misfit.mean() for misfit in misfits]))
        clear = all(fits_better(misfits[best], misfits[k]) for k in range(len(possible)) if k != best)
        return possible[best] if clear or not may_wait else None

    def _fits_what_moves(self, views: FloatArray, first: FloatArray, last: FloatArray) -> BoolArray:
        """Return (n,) which features move in the picture, or stay and fit the pose that the others give.

        Many that never move would be inliers of a camera that does not turn.
        """
        moves = ~stays_in_picture(self._camera, views, self._tracking.forward_backward_px)
        if moves.all():
            return moves
        last_pose = self._relative_pose(first[moves], last[moves], self._start.min_inliers)
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

    def _relative_pose(self, first: FloatArray, last: FloatArray, least: int) -> FloatArray | None:
        """Return the pose (4, 4) of the last view in the first with a unit baseline, or None.

        So many features at least have to agree with it.
        """
        if len(first) < least:
            return None
        essential, mask = cv2.findEssentialMat(
            first, last, self._K, method=cv2.USAC_MAGSAC, prob=0.9999, threshold=self._start.max_error_px
        )
        if essential is None or essential.shape != (3, 3):
            return None
        count, rotation, translation, _ = cv2.recoverPose(essential, first, last, self._K, mask=mask)
        if count < least:
            return None
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ translation[:, 0]
        return pose

    def _directions(self, first: FloatArray, last: FloatArray) -> FloatArray:
        """Return directions (M, 3) of the last view in the first that features may show."""
        poses = poses_over_plane(self._K, first, last, self._start.max_error_px)
        pose = self._relative_pose(first, last, least=_LEAST_OF_HALF)
        if pose is not None:
            poses.append(pose)
        return np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)

    def _view_poses(
        self,
        uv_px: FloatArray,
        points: FloatArray,
        known: Mapping[int, FloatArray],
        rng: np.random.Generator,
    ) -> FloatArray | None:
        """Return the pose (V, 4, 4) of every view from points (n, 3) seen there at (n, V, 2).

        Args:
            uv_px: Undistorted pixels, NaN where unknown.
            points: Positions.
            known: Poses of the two views that gave them.
            rng: Draws the samples.
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
            pose = lmeds_pose(self._K, matches, guesses, self._tracking.lmeds_samples, rng)
            matches = matches.where(matches.inliers(self._K, pose, 2 * self._tracking.inlier_px))
            guess, _ = refine_pose(self._K, pose, matches, np.ones(len(matches)))
            poses[view] = guess
        return poses

    def _median_flow(self, first: FloatArray, last: FloatArray) -> float:
        """Return how far the median feature moved in the picture."""
        moved = distort(self._camera, last) - distort(self._camera, first)
        return float(np.nanmedian(np.linalg.norm(moved, axis=1)))

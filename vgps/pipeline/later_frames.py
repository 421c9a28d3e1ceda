"""Pose the frames after a window again, by what the window refined and by what they show themselves.

Their tracked poses lean on positions that were triangulated by poses which the window has corrected since,
and so do the positions of the features that came after it. Frame by frame, as stages A and B did it, each
pose comes from refined positions (18), and each other position from the poses so far (19).
"""

from dataclasses import dataclass

import numpy as np

from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import largest_angle_rad, world_rays
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import scaled_pose
from vgps.model import BoolArray, Camera, FloatArray, IntArray
from vgps.rolling_shutter import row_poses
from vgps.solution import Observations
from vgps.tracking.mapper import MIN_VIEWS, agreed_positions
from vgps.tracking.pose import Correspondences, Prediction, refine_pose
from vgps.tracking.row_motion import row_shifts


@dataclass(frozen=True)
class PosingLimits:
    """What frames after the window are posed by.

    Attributes:
        tracking, mapping: How well features have to agree with a pose, and views with a position.
        min_features: A frame with fewer features keeps its tracked motion.
        rotation_sigma_rad: Standard deviation of the tracked rotation from frame to frame, which counts as an
            observation where it is a gyro's; else inf.
    """

    tracking: TrackingConfig
    mapping: MappingConfig
    min_features: int
    rotation_sigma_rad: float = np.inf


@dataclass(frozen=True)
class Features:
    """Positions (T, 3) and reliabilities (T,) of a map's features, and whether stage C refined each (T,)."""

    points: FloatArray
    sigma_px: FloatArray
    refined: BoolArray


@dataclass(frozen=True)
class FramePoser:
    """Estimator of the poses of frames after a window."""

    features: Features
    camera: Camera
    limits: PosingLimits

    def posed_again(self, local_map: LocalMap, poses: FloatArray, start: int, scale: float) -> FloatArray:
        """Return poses (n, 4, 4) of a map whose rows from ``start`` on are posed again.

        Args:
            local_map: The map, with the tracked motion and the observations.
            poses: (n, 4, 4) the refined poses in the rows before ``start``.
            start: Row of the first later frame.
            scale: By which the tracked motion changes.
        """
        poses, tracked = poses.copy(), local_map.poses
        views = _by_feature(local_map, start)
        for row in range(start, len(poses)):
            step = np.linalg.inv(tracked[row - 1]) @ tracked[row]
            moved = poses[row - 1] @ scaled_pose(step, scale)
            seen = views.rows(views.frame == row)
            earlier = self._earlier_views(views, seen, poses[:row])
            points, sigma_px = self._positions(local_map.t_s, poses, seen.landmark, earlier)
            known = np.isfinite(points[:, 0])
            points, uv_px = points[known], seen.uv_px[known]
            uv_px = uv_px - self._row_shifts(local_map.t_s[row - 1 : row + 1], poses[row - 1], moved, points)
            matches = Correspondences(points, uv_px, lens_jacobian(self.camera, uv_px))
            poses[row] = self._pose(matches, sigma_px[known], moved)
        return poses

    def _row_shifts(
        self, t_s: FloatArray, before: FloatArray, moved: FloatArray, points: FloatArray
    ) -> FloatArray | float:
        """Return how far a rolling shutter shifts points (n, 3) in a frame, (n, 2) pixels.

        Args:
            t_s: (2,) times of the frame before and of this one.
            before, moved: (4, 4) their poses, this one's by the tracked motion.
            points: The points.
        """
        if not self.camera.readout_s:
            return 0.0
        return row_shifts(self.camera, t_s - t_s[1], np.stack([before, moved]), moved, points)

    def _earlier_views(self, views: Observations, seen: Observations, poses: FloatArray) -> Observations:
        """Return the views before a frame of features seen in it whose position is not refined.

        One without any may move on its own.
        """
        features, wanted = self.features, np.zeros(len(self.features.refined), dtype=bool)
        wanted[seen.landmark] = np.isfinite(features.points[seen.landmark, 0])
        wanted &= ~features.refined
        posed = np.append(np.isfinite(poses[:, 0, 0]), False)  # False for this frame and those after it
        earlier = views.rows(wanted[views.landmark] & posed[np.minimum(views.frame, len(poses))])
        count = np.bincount(earlier.landmark, minlength=len(wanted))
        return earlier.rows(count[earlier.landmark] >= MIN_VIEWS)

    def _positions(
        self, t_s: FloatArray, poses: FloatArray, ids: IntArray, views: Observations
    ) -> tuple[FloatArray, FloatArray]:
        """Return positions (n, 3) and reliabilities (n,) of features (n,): refined, else by their views."""
        features = self.features
        refined = features.refined[ids]
        points = np.where(refined[:, None], features.points[ids], np.nan)
        sigma_px = np.where(refined, features.sigma_px[ids], np.nan)
        start = np.flatnonzero(np.diff(views.landmark, prepend=-1))
        if not len(start):
            return points, sigma_px
        camera, mapping = self.camera, self.limits.mapping
        first, last = int(views.frame.min()), int(views.frame.max()) + 1
        of_row = row_poses(camera, t_s[first:last], poses[first:last], views.frame - first, views.uv_px)
        found, sigma = agreed_positions(camera, mapping, of_row, views.uv_px, start)
        angle = largest_angle_rad(world_rays(camera.K, of_row, views.uv_px), start)
        found[angle <= np.radians(mapping.min_parallax_deg)] = np.nan
        order = np.argsort(ids)
        rows = order[np.searchsorted(ids, views.landmark[start], sorter=order)]
        points[rows], sigma_px[rows] = found, sigma
        return points, sigma_px

    def _pose(self, matches: Correspondences, sigma_px: FloatArray, start: FloatArray) -> FloatArray:
        """Return a frame's pose by features of these reliabilities (n,), or ``start`` if too few fit it.

        The tracked motion may be wrong, so all features count first, not only those that fit it.
        """
        K, tracking = self.camera.K, self.limits.tracking
        least = max(self.limits.min_features, tracking.min_inlier_share * len(matches))
        if len(matches) < least:
            return start
        mu, tracked = 0.5 / sigma_px**2, Prediction(start, self.limits.rotation_sigma_rad)
        pose, _ = refine_pose(K, start, matches, mu, prior=tracked)
        inliers = matches.inliers(K, pose, tracking.inlier_px)
        if inliers.sum() < least:
            return start
        pose, _ = refine_pose(K, pose, matches.where(inliers), mu[inliers], prior=tracked)
        return pose


def _by_feature(local_map: LocalMap, start: int) -> Observations:
    """Return the observations of the last views before a row and of all after it, sorted by feature.

    Frames are rows of the map's poses.
    """
    since = max(0, start - local_map.views.shape[1])
    views = local_map.observations(local_map.first_frame + since)
    order = np.argsort(views.landmark, kind="stable")
    return Observations(views.frame - local_map.first_frame, views.landmark, views.uv_px).rows(order)

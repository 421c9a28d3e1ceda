"""Merge the result of stage C on a snapshot of a map into the map, which has grown since."""

from dataclasses import dataclass

import numpy as np

from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.mapping.zero_motion import scaled_pose
from vgps.model import BoolArray, Camera, FloatArray, IntArray
from vgps.tracking.pose import Correspondences, Prediction, refine_pose


@dataclass(frozen=True)
class Reconciliation:
    """The update of the map, and its features (n,) with a position that stage C did not refine."""

    update: MapUpdate
    unrefined: IntArray


@dataclass(frozen=True)
class PosingLimits:
    """What frames after the window are posed by.

    Attributes:
        inlier_px: Limit of the reprojection error of observations that pose a frame.
        min_features: A frame with fewer refined features keeps its tracked motion.
        rotation_sigma_rad: Standard deviation of the tracked rotation from frame to frame, which counts as an
            observation where it is a gyro's; else inf.
    """

    inlier_px: float
    min_features: int
    rotation_sigma_rad: float = np.inf


@dataclass(frozen=True)
class _Features:
    """Positions (T, 3) and reliabilities (T,) of a map's features, and whether stage C refined each (T,)."""

    points: FloatArray
    sigma_px: FloatArray
    refined: BoolArray


@dataclass(frozen=True)
class _FramePoser:
    """Estimator of frame poses from the refined features."""

    features: _Features
    camera: Camera
    limits: PosingLimits

    def pose(self, ids: IntArray, uv_px: FloatArray, start: FloatArray) -> FloatArray:
        """Return a frame's pose by its observations (n, 2) of features (n,), or ``start`` if they are too
        few."""
        refined = self.features.refined[ids]
        ids, uv_px = ids[refined], uv_px[refined]
        matches = Correspondences(self.features.points[ids], uv_px, lens_jacobian(self.camera, uv_px))
        inliers = matches.inliers(self.camera.K, start, self.limits.inlier_px)
        if inliers.sum() < self.limits.min_features:
            return start
        mu = 0.5 / self.features.sigma_px[ids[inliers]] ** 2
        tracked = Prediction(start, self.limits.rotation_sigma_rad)
        pose, _ = refine_pose(self.camera.K, start, matches.where(inliers), mu, prior=tracked)
        return pose


def reconcile(refined: LocalMap, local_map: LocalMap, camera: Camera, limits: PosingLimits) -> Reconciliation:
    """Return how a map changes so that it agrees with a refined snapshot of itself.

    Frames added since the snapshot keep their motion, at the scale that the features have now, and are then
    posed by the refined positions, Eq. (18), so that the next frames fit both. Positions added since move
    with the snapshot's newest frame; positions removed since stay removed.

    Args:
        refined: A :meth:`LocalMap.snapshot`, optimised.
        local_map: The map; it may have grown and may have discarded its oldest frames and features.
        camera: Intrinsics.
        limits: What frames added since are posed by.
    """
    newest = refined.next_frame - 1
    discarded = local_map.discarded_features - refined.discarded_features
    before, after = local_map.pose(newest), refined.pose(newest)
    scale = _depth_ratio(
        before, after, local_map.points[refined.ids - discarded], refined.points[refined.ids]
    )
    features = _moved_features(refined, local_map, newest, scale)
    poses = local_map.poses.copy()
    count = newest + 1 - local_map.first_frame
    poses[:count] = refined.poses[local_map.first_frame - refined.first_frame :]
    poses = _pose_later_frames(local_map, poses, count, scale, _FramePoser(features, camera, limits))
    positioned = np.isfinite(local_map.points[:, 0])
    ids = np.flatnonzero(positioned)
    update = MapUpdate(
        first_frame=local_map.first_frame,
        poses=poses,
        positions=Positions(ids, features.points[ids], features.sigma_px[ids]),
        zero_motions=tuple(m.scaled(scale) for m in local_map.zero_motions if m.frame > newest),
    )
    return Reconciliation(update, np.flatnonzero(positioned & ~features.refined))


def _depth_ratio(before: FloatArray, after: FloatArray, old: FloatArray, new: FloatArray) -> float:
    """Return the median ratio of the depths of points (n, 3) after and before."""
    depth_before = (old - before[:3, 3]) @ before[:3, 2]
    depth_after = (new - after[:3, 3]) @ after[:3, 2]
    both = (depth_before > 0.0) & (depth_after > 0.0)  # false for NaN as well
    return float(np.median(depth_after[both] / depth_before[both])) if both.any() else 1.0


def _moved_features(refined: LocalMap, local_map: LocalMap, newest: int, scale: float) -> _Features:
    """Return the snapshot's positions, and where it has none the map's, moved with the newest frame."""
    discarded = local_map.discarded_features - refined.discarded_features
    before, after = local_map.pose(newest), refined.pose(newest)
    points = np.full((local_map.feature_count, 3), np.nan)
    sigma_px = np.full(local_map.feature_count, np.nan)
    count = refined.feature_count - discarded
    points[:count], sigma_px[:count] = refined.points[discarded:], refined.sigma_px[discarded:]
    positioned = np.isfinite(local_map.points[:, 0])
    is_refined = positioned & np.isfinite(points[:, 0])
    others = np.flatnonzero(positioned & ~is_refined)
    in_camera = (local_map.points[others] - before[:3, 3]) @ before[:3, :3]
    points[others] = scale * in_camera @ after[:3, :3].T + after[:3, 3]
    sigma_px[others] = local_map.sigma_px[others]
    return _Features(points, sigma_px, is_refined)


def _pose_later_frames(
    local_map: LocalMap, poses: FloatArray, start: int, scale: float, poser: _FramePoser
) -> FloatArray:
    """Return poses (n, 4, 4) whose rows from ``start`` on are the tracked motion, scaled, refined by (18)."""
    poses, tracked = poses.copy(), local_map.poses
    observations = local_map.observations(local_map.first_frame + start)
    for row in range(start, len(poses)):
        step = np.linalg.inv(tracked[row - 1]) @ tracked[row]
        moved = poses[row - 1] @ scaled_pose(step, scale)
        rows = np.flatnonzero(observations.frame == local_map.first_frame + row)
        poses[row] = poser.pose(observations.landmark[rows], observations.uv_px[rows], moved)
    return poses

"""Bring the result of stage C, found on a snapshot of a map, into the map as it has grown since."""

from dataclasses import dataclass

import numpy as np

from vgps.geometry import reprojection_inliers
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.mapping.zero_motion import scaled_pose
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.tracking.pose import refine_pose

_MIN_FEATURES = 12  # a frame with fewer keeps its own motion


@dataclass(frozen=True)
class Reconciliation:
    """The update of the map, and the features (n,) with a position that the snapshot does not know."""

    update: MapUpdate
    unknown: IntArray


@dataclass(frozen=True)
class _Features:
    """Position (T, 3), reliability (T,) and whether it comes from the snapshot (T,), of a map's features."""

    points: FloatArray
    sigma_px: FloatArray
    trusted: BoolArray


@dataclass(frozen=True)
class _Poser:
    """Poses frames by the trusted features."""

    features: _Features
    K: FloatArray
    inlier_px: float

    def pose(self, ids: IntArray, uv_px: FloatArray, start: FloatArray) -> FloatArray:
        """Return a frame's pose by its observations (n, 2) of features (n,), or the start if they are too
        few."""
        trusted = self.features.trusted[ids]
        ids, uv_px = ids[trusted], uv_px[trusted]
        points = self.features.points[ids]
        good = reprojection_inliers(self.K, start, points, uv_px, self.inlier_px)
        if good.sum() < _MIN_FEATURES:
            return start
        mu = 0.5 / self.features.sigma_px[ids[good]] ** 2
        pose, _ = refine_pose(self.K, start, points[good], uv_px[good], mu)
        return pose


def reconcile(refined: LocalMap, local_map: LocalMap, K: FloatArray, inlier_px: float) -> Reconciliation:
    """Return how a map changes so that it agrees with a refined snapshot of itself.

    Frames that came since keep their motion, at the scale that the features have now, and are posed anew by
    the refined positions (18), so that what is tracked next fits both. Features positioned since are moved
    alike. A position that was given up since stays so.

    Args:
        refined: A :meth:`LocalMap.snapshot` that was optimised.
        local_map: The map; may have grown, and may have discarded its oldest frames and features.
        K: (3, 3).
        inlier_px: Observations farther off than this take no part.
    """
    newest = refined.next_frame - 1
    discarded = local_map.discarded_features - refined.discarded_features
    before, after = local_map.pose(newest), refined.pose(newest)
    scale = _depth_ratio(
        before, after, local_map.points[refined.ids - discarded], refined.points[refined.ids]
    )
    features = _moved_features(refined, local_map, newest, scale)
    poses = local_map.poses.copy()
    known = newest + 1 - local_map.first_frame
    poses[:known] = refined.poses[local_map.first_frame - refined.first_frame :]
    poses = _posed_since(local_map, poses, known, scale, _Poser(features, K, inlier_px))
    positioned = np.isfinite(local_map.points[:, 0])
    ids = np.flatnonzero(positioned)
    update = MapUpdate(
        first_frame=local_map.first_frame,
        poses=poses,
        positions=Positions(ids, features.points[ids], features.sigma_px[ids]),
        zero_motions=tuple(held.scaled(scale) for held in local_map.zero_motions if held.frame > newest),
    )
    return Reconciliation(update, np.flatnonzero(positioned & ~features.trusted))


def _depth_ratio(before: FloatArray, after: FloatArray, old: FloatArray, new: FloatArray) -> float:
    """Return how much farther from the camera points (n, 3) are now, in the median."""
    depth_before = (old - before[:3, 3]) @ before[:3, 2]
    depth_after = (new - after[:3, 3]) @ after[:3, 2]
    both = (depth_before > 0.0) & (depth_after > 0.0)  # false of NaN as well
    return float(np.median(depth_after[both] / depth_before[both])) if both.any() else 1.0


def _moved_features(refined: LocalMap, local_map: LocalMap, newest: int, scale: float) -> _Features:
    """Take positions from the snapshot where it has them, else move the map's own with the newest frame."""
    discarded = local_map.discarded_features - refined.discarded_features
    before, after = local_map.pose(newest), refined.pose(newest)
    points = np.full((local_map.feature_count, 3), np.nan)
    sigma_px = np.full(local_map.feature_count, np.nan)
    known = refined.feature_count - discarded
    points[:known], sigma_px[:known] = refined.points[discarded:], refined.sigma_px[discarded:]
    positioned = np.isfinite(local_map.points[:, 0])
    trusted = positioned & np.isfinite(points[:, 0])
    own = np.flatnonzero(positioned & ~trusted)
    in_camera = (local_map.points[own] - before[:3, 3]) @ before[:3, :3]
    points[own] = scale * in_camera @ after[:3, :3].T + after[:3, 3]
    sigma_px[own] = local_map.sigma_px[own]
    return _Features(points, sigma_px, trusted)


def _posed_since(
    local_map: LocalMap, poses: FloatArray, known: int, scale: float, poser: _Poser
) -> FloatArray:
    """Return poses (n, 4, 4) whose rows from ``known`` on follow: the frames' own motion, scaled, then
    (18)."""
    poses, old = poses.copy(), local_map.poses
    seen = local_map.observations(local_map.first_frame + known)
    for row in range(known, len(poses)):
        step = np.linalg.inv(old[row - 1]) @ old[row]
        moved = poses[row - 1] @ scaled_pose(step, scale)
        rows = np.flatnonzero(seen.frame == local_map.first_frame + row)
        poses[row] = poser.pose(seen.landmark[rows], seen.uv_px[rows], moved)
    return poses

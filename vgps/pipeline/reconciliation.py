"""What stage C made of a map as it was, put into the map as it has grown since."""

import numpy as np

from vgps.geometry import reprojection_inliers
from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import scaled_pose
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.tracking.pose import refine_pose

_LEAST = 12  # features that a frame is posed by anew


def reconcile(refined: LocalMap, local_map: LocalMap, K: FloatArray, inlier_px: float) -> IntArray:
    """Put the poses and positions of a refined copy into the map that it was taken from, in place.

    Frames that came since keep their motion, at the scale that the features have now, and are posed anew by
    the refined positions (18): what is tracked next fits both. Features positioned since are moved alike. A
    position that was given up since stays so.

    Args:
        refined: A :meth:`LocalMap.snapshot` that was optimised.
        local_map: May have grown, and may have forgotten its oldest frames and features.
        K: (3, 3).
        inlier_px: Observations farther off than this take no part.

    Returns:
        Features whose position the copy does not know.
    """
    newest = refined.next_frame - 1
    before, after = local_map.pose(newest).copy(), refined.pose(newest)
    dropped = local_map.forgotten_features - refined.forgotten_features
    scale = _growth(before, after, local_map.points[refined.ids - dropped], refined.points[refined.ids])
    old = local_map.poses[newest - local_map.first_frame :].copy()
    own = _move_points(refined, local_map, before, after, scale)
    known = newest + 1 - local_map.first_frame
    local_map.poses[:known] = refined.poses[local_map.first_frame - refined.first_frame :]
    trusted = np.isfinite(local_map.points[:, 0])
    trusted[own] = False
    _pose_anew(local_map, old, scale, trusted, K, inlier_px)
    local_map.zero_motions = [
        tie.scaled(scale) if tie.frame > newest else tie for tie in local_map.zero_motions
    ]
    return own


def _pose_anew(
    local_map: LocalMap, old: FloatArray, scale: float, trusted: BoolArray, K: FloatArray, inlier_px: float
) -> None:
    """Frames after the newest refined one: their own motion from ``old`` (n, 4, 4), which begins with that
    one, scaled, then by features whose position is trusted."""
    since = local_map.next_frame - len(old) + 1
    seen = local_map.observations(since)
    for row, frame in enumerate(range(since, local_map.next_frame), start=1):
        step = np.linalg.inv(old[row - 1]) @ old[row]
        moved = local_map.pose(frame - 1) @ scaled_pose(step, scale)
        rows = np.flatnonzero(seen.frame == frame)
        rows = rows[trusted[seen.landmark[rows]]]
        ids, uv = seen.landmark[rows], seen.uv_px[rows]
        local_map.poses[frame - local_map.first_frame] = _posed(local_map, ids, uv, K, moved, inlier_px)


def _growth(before: FloatArray, after: FloatArray, old: FloatArray, new: FloatArray) -> float:
    """How much farther from the camera the points (n, 3) are, in the median."""
    depth_before = (old - before[:3, 3]) @ before[:3, 2]
    depth_after = (new - after[:3, 3]) @ after[:3, 2]
    both = (depth_before > 0.0) & (depth_after > 0.0)  # false of NaN as well
    return float(np.median(depth_after[both] / depth_before[both])) if both.any() else 1.0


def _posed(
    local_map: LocalMap, ids: IntArray, uv_px: FloatArray, K: FloatArray, moved: FloatArray, inlier_px: float
) -> FloatArray:
    """A frame's pose by its observations (n, 2) of features (n,), from where it is thought to be."""
    points = local_map.points[ids]
    good = reprojection_inliers(K, moved, points, uv_px, inlier_px)
    if good.sum() < _LEAST:
        return moved
    mu = 0.5 / local_map.sigma_px[ids[good]] ** 2
    pose, _ = refine_pose(K, moved, points[good], uv_px[good], mu)
    return pose


def _move_points(
    refined: LocalMap, local_map: LocalMap, before: FloatArray, after: FloatArray, scale: float
) -> IntArray:
    """The copy's positions where both have one, the map's own, moved, where the copy has none: those (n,)."""
    dropped = local_map.forgotten_features - refined.forgotten_features
    found = np.full((local_map.feature_count, 3), np.nan)
    sigma = np.full(local_map.feature_count, np.nan)
    known = refined.feature_count - dropped
    found[:known], sigma[:known] = refined.points[dropped:], refined.sigma_px[dropped:]
    positioned = np.isfinite(local_map.points[:, 0])
    own = np.flatnonzero(positioned & np.isnan(found[:, 0]))
    in_camera = (local_map.points[own] - before[:3, 3]) @ before[:3, :3]
    found[own] = scale * in_camera @ after[:3, :3].T + after[:3, 3]
    sigma[own] = local_map.sigma_px[own]
    ids = np.flatnonzero(positioned)
    local_map.set_points(ids, found[ids], sigma[ids])
    return np.asarray(own)

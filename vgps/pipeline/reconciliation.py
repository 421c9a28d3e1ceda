"""Merge the result of stage C on a snapshot of a map into the map, which has grown since."""

from dataclasses import dataclass

import numpy as np

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import Camera, FloatArray, IntArray
from vgps.pipeline.later_frames import Features, FramePoser, PosingLimits


@dataclass(frozen=True)
class Reconciliation:
    """The update of the map, and its features (n,) with a position that stage C did not refine."""

    update: MapUpdate
    unrefined: IntArray


def reconcile(refined: LocalMap, local_map: LocalMap, camera: Camera, limits: PosingLimits) -> Reconciliation:
    """Return how a map changes so that it agrees with a refined snapshot of itself.

    Frames added since the snapshot are posed again, one after the other, by what stage C refined and by
    positions that follow from it; where features are too few they keep their motion, at the scale that the
    features have now. Positions added since move with the snapshot's newest frame; positions removed since
    stay removed.

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
    shared = slice(local_map.first_frame - refined.first_frame, None)
    poses[:count] = refined.poses[shared]
    bending = np.append(refined.bending[shared], np.full(len(poses) - count, np.nan))
    poses = FramePoser(features, camera, limits).posed_again(local_map, poses, count, scale)
    positioned = np.isfinite(local_map.points[:, 0])
    ids = np.flatnonzero(positioned)
    update = MapUpdate(
        first_frame=local_map.first_frame,
        poses=poses,
        bending=bending,
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


def _moved_features(refined: LocalMap, local_map: LocalMap, newest: int, scale: float) -> Features:
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
    return Features(points, sigma_px, is_refined)

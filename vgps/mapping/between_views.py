"""Poses of frames without a view before their map had started."""

import numpy as np

from vgps.geometry import interpolate_poses
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate


def pose_between_views(local_map: LocalMap) -> MapUpdate:
    """Return poses for frames between views: by zero-motion constraints, or interpolated if bridged."""
    poses, first = local_map.poses.copy(), local_map.first_frame
    for motion in local_map.zero_motions:
        if np.isnan(poses[motion.frame - first, 0, 0]):
            poses[motion.frame - first] = poses[motion.reference - first] @ motion.reference_T_frame
    known = np.flatnonzero(np.isfinite(poses[:, 0, 0]))
    rows = np.array(sorted(local_map.bridged), dtype=int) - first
    rows = rows[np.isnan(poses[rows, 0, 0]) & (rows > known.min(initial=len(poses)))]
    if len(rows):
        poses[rows] = interpolate_poses(local_map.t_s[known], poses[known], local_map.t_s[rows])
    return MapUpdate(first_frame=first, poses=poses)

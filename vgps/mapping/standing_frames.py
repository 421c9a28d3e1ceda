"""Poses of frames in which the camera stood still before their map had started."""

import numpy as np

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate


def pose_standing_frames(local_map: LocalMap) -> MapUpdate:
    """Return poses for standing frames without one, by their zero-motion constraints."""
    poses, first = local_map.poses.copy(), local_map.first_frame
    for motion in local_map.zero_motions:
        if np.isnan(poses[motion.frame - first, 0, 0]):
            poses[motion.frame - first] = poses[motion.reference - first] @ motion.reference_T_frame
    return MapUpdate(first_frame=first, poses=poses)

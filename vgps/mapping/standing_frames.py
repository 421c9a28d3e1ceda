"""Poses of frames that stood still before their map had any."""

import numpy as np

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate


def pose_standing_frames(local_map: LocalMap) -> MapUpdate:
    """Return poses for standing frames without one: that of their view, moved by their constraint."""
    poses, first = local_map.poses.copy(), local_map.first_frame
    for held in local_map.zero_motions:
        if np.isnan(poses[held.frame - first, 0, 0]):
            poses[held.frame - first] = poses[held.key - first] @ held.key_T_frame
    return MapUpdate(first_frame=first, poses=poses)

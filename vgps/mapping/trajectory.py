"""The path of a local map: as optimised so far, and as tracked before fixes changed it."""

import numpy as np

from vgps.mapping.local_map import LocalMap
from vgps.solution import Trajectory


def map_trajectory(local_map: LocalMap, since_s: float = -np.inf) -> Trajectory:
    """Return the poses of a map from its first posed frame or a later time on, as a view of the map."""
    first = max(local_map.first_posed - local_map.first_frame, int(np.searchsorted(local_map.t_s, since_s)))
    return Trajectory(local_map.t_s[first:], local_map.poses[first:])


def odometry_trajectory(local_map: LocalMap, since_s: float = -np.inf) -> Trajectory:
    """Return the same frames with the displacements as they were tracked.

    Stage C bends the path to fixes whose clock is late, which hides their time offset; the odometry still
    shows it.
    """
    path = map_trajectory(local_map, since_s)
    poses = path.world_T_camera
    tracked = local_map.odometry[len(local_map.odometry) - len(poses) + 1 :]
    steps = np.where(
        np.isfinite(tracked),
        (poses[:-1, :3, :3] @ tracked[:, :, None])[:, :, 0],
        np.diff(poses[:, :3, 3], axis=0),
    )
    out = poses.copy()
    out[1:, :3, 3] = poses[0, :3, 3] + np.cumsum(steps, axis=0)
    return Trajectory(path.t_s, out)

"""Drives around a block of houses, which pass the same street again."""

import numpy as np
from scipy.spatial.transform import Rotation


def block_laps(
    laps: float, climb: float = 0.0, side_m: float = 60.0, step_m: float = 0.5, lane_m: float = 0.0
) -> np.ndarray:
    """Return KITTI's poses (N, 4, 4) of a camera that drives around a block and turns right at its corners.

    Args:
        laps: Number of laps.
        climb: Metres up for a metre of the way.
        side_m: Side of the block.
        step_m: Distance from pose to pose.
        lane_m: How far to the right the second lap lies.
    """
    along, corner_m = np.arange(0.0, laps * 4 * side_m, step_m), side_m / 5
    corner, rest = np.divmod(along + side_m / 2, side_m)
    share = np.clip((rest - side_m + corner_m) / corner_m, 0.0, 1.0)
    yaw = np.radians(90.0 * (corner + share**3 * (10 - 15 * share + 6 * share**2)))
    poses = np.tile(np.eye(4), (len(along), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("y", yaw[:, None]).as_matrix()
    steps = step_m * np.stack([np.sin(yaw), np.zeros_like(yaw), np.cos(yaw)], axis=-1)
    poses[1:, :3, 3] = np.cumsum(steps, axis=0)[:-1]
    poses[:, :3, 3] += lane_m * np.clip(along / (4 * side_m) - 0.5, 0.0, 1.0)[:, None] * poses[:, :3, 0]
    poses[:, 1, 3] = -climb * along
    return poses

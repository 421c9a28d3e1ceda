"""The similarity between two sets of poses of the same cameras, where rotations count as well as places."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.mapping.map_update import Similarity
from vgps.model import FloatArray

_NO_MOTION = 1e-9


def similarity_of_poses(world_T_camera: FloatArray, map_T_camera: FloatArray) -> Similarity:
    """Return the similarity from map to world by cameras' poses (N, 4, 4) in both.

    The rotation is the mean over these cameras, the scale the ratio of their spreads.
    """
    world_p_mean, map_p_mean = world_T_camera[:, :3, 3].mean(axis=0), map_T_camera[:, :3, 3].mean(axis=0)
    world_spread = float(np.linalg.norm(world_T_camera[:, :3, 3] - world_p_mean))
    map_spread = float(np.linalg.norm(map_T_camera[:, :3, 3] - map_p_mean))
    turns = world_T_camera[:, :3, :3] @ map_T_camera[:, :3, :3].transpose(0, 2, 1)
    rotation = np.asarray(Rotation.from_matrix(turns).mean().as_matrix(), np.float64)
    scale = world_spread / max(map_spread, _NO_MOTION)
    return Similarity(scale, rotation, world_p_mean - scale * rotation @ map_p_mean)

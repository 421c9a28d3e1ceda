"""Small trajectories for tests of errors."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.solution import Trajectory


def trajectory(t_s: object, position: object, rotation: Rotation | None = None) -> Trajectory:
    times = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    poses[:, :3, 3] = position
    if rotation is not None:
        poses[:, :3, :3] = rotation.as_matrix()
    return Trajectory(times, poses)


def random_walk(seed: int, frames: int = 40) -> Trajectory:
    rng = np.random.default_rng(seed)
    position = np.cumsum(rng.normal(size=(frames, 3)), axis=0)
    return trajectory(np.arange(frames) / 10, position, Rotation.random(frames, random_state=rng))

"""A local map as tracking leaves it, made from the synthetic drive, and fixes on its true path."""

import numpy as np
from synthetic_bundle import ANTENNA, K, drive

from vgps.gps.fixes import Fixes
from vgps.mapping.local_map import LocalMap

MATRIX = np.array([[K[0], 0.0, K[2]], [0.0, K[1], K[3]], [0.0, 0.0, 1.0]])
INTERVAL_S = 0.1


def map_of(problem, first, last, history=60):
    """Frames first..last with the problem's poses, observations and points; in the world."""
    made = LocalMap(first, history)
    of_id: list[int] = []  # landmark of every feature
    for frame in range(first, last + 1):
        rows = np.flatnonzero(problem.frame == frame)
        uv = dict(zip(problem.landmark[rows].tolist(), problem.uv_px[rows], strict=True))
        made.append_pose(problem.world_T_camera[frame])
        followed = [of_id[feature] for feature in made.ids.tolist()]
        found = np.array([landmark in uv for landmark in followed], dtype=bool)
        seen = np.array([uv.get(landmark, np.zeros(2)) for landmark in followed]).reshape(-1, 2)
        made.push_view(frame, seen, seen, found)
        new = [landmark for landmark in uv if landmark not in set(np.array(followed)[found].tolist())]
        at = np.array([uv[landmark] for landmark in new]).reshape(-1, 2)
        made.add_features(at, at, np.zeros(len(new), dtype=np.uint8))
        of_id.extend(new)
    made.set_points(np.arange(len(of_id)), problem.world_p_landmark[of_id], np.full(len(of_id), 0.5))
    made.aligned = True
    return made


def scene(frames=60, disturbed=0.3, seed=0):
    """Problem, its true poses, frame times, and a fix every four frames between two of them."""
    problem, poses = drive(frames, 700, seed=seed, disturbed=disturbed)
    antenna = poses[:, :3, 3] + poses[:, :3, :3] @ ANTENNA
    row = np.arange(0, frames - 1, 4)
    t_s = INTERVAL_S * np.arange(frames)
    n = len(row)
    fixes = Fixes(
        t_s[row] + 0.3 * INTERVAL_S,
        0.7 * antenna[row] + 0.3 * antenna[row + 1],
        np.full(n, 0.1),
        np.full(n, 0.1),
        np.full(n, np.nan),
        np.full(n, np.nan),
        np.full((n, 3), np.nan),
        np.ones(n, dtype=bool),
        np.full(n, 10.0),
    )
    return problem, poses, t_s, fixes


def away(poses, true):
    """Mean distance of the camera centres."""
    return float(np.linalg.norm(poses[:, :3, 3] - true[:, :3, 3], axis=1).mean())

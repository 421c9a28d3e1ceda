"""A local map as tracking leaves it, made from the synthetic drive, and fixes on its true path."""

from functools import cache

import numpy as np
from synthetic_bundle import ANTENNA, K, drive
from synthetic_fixes import fixes_of_size

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFeatures, NewFrame, NewView, Positions
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import Camera
from vgps.smoothing.context import SmoothingContext

MATRIX = np.array([[K[0], 0.0, K[2]], [0.0, K[1], K[3]], [0.0, 0.0, 1.0]])
CAMERA = Camera(model="pinhole", width=640, height=480, fx=K[0], fy=K[1], cx=K[2], cy=K[3])
INTERVAL_S = 0.1


def context(config):
    """The drive's camera with these settings."""
    return SmoothingContext(CAMERA, config)


def moved(local_map, since, change):
    """Change poses (n, 4, 4) of a map from frame ``since`` on by a function."""
    poses = local_map.poses[since - local_map.first_frame :].copy()
    local_map.apply(MapUpdate(first_frame=since, poses=change(poses)))


def map_of(problem, first, last, history=60, aligned=True, stop=(-1, 0)):
    """Frames first..last with the problem's poses, observations and points, and a stop.

    ``stop`` is the frame after which the camera stands, and for how many frames.
    """
    made = LocalMap(first, history)
    of_id: list[int] = []  # landmark of every feature
    for frame in range(first, last + 1):
        rows = np.flatnonzero(problem.frame == frame)
        uv = dict(zip(problem.landmark[rows].tolist(), problem.uv_px[rows], strict=True))
        followed = [of_id[feature] for feature in made.ids.tolist()]
        found = np.array([landmark in uv for landmark in followed], dtype=bool)
        seen = np.array([uv.get(landmark, np.zeros(2)) for landmark in followed]).reshape(-1, 2)
        number = made.next_frame
        pose = NewFrame(INTERVAL_S * number, problem.world_T_camera[frame])
        made.apply(MapUpdate(frames=(pose,), view=NewView(number, seen, seen, found)))
        still = set(np.array(followed)[found].tolist())
        new = [landmark for landmark in uv if landmark not in still]
        at = np.array([uv[landmark] for landmark in new]).reshape(-1, 2)
        made.apply(MapUpdate(features=NewFeatures(at, at, np.zeros(len(new), dtype=np.uint8))))
        of_id.extend(new)
        for standing in range(number + 1, number + 1 + stop[1]) if frame == stop[0] else ():
            still_there = NewFrame(INTERVAL_S * standing, problem.world_T_camera[frame])
            held = ZeroMotion(standing, number, np.eye(4), np.full(6, 1e-3))
            made.apply(MapUpdate(frames=(still_there,), zero_motions=(held,)))
    sigma_px = np.full(len(of_id), 0.5)
    positions = Positions(np.arange(len(of_id)), problem.world_p_landmark[of_id], sigma_px)
    made.apply(MapUpdate(positions=positions, aligned=aligned))
    return made


@cache
def scene(frames=60, disturbed=0.3, seed=0):
    """Problem, its true poses, frame times, and a fix every four frames between two of them; read-only."""
    problem, poses = drive(frames, 700, seed=seed, disturbed=disturbed)
    antenna = poses[:, :3, 3] + poses[:, :3, :3] @ ANTENNA
    row = np.arange(0, frames - 1, 4)
    t_s = INTERVAL_S * np.arange(frames)
    n = len(row)
    fixes = fixes_of_size(
        t_s[row] + 0.3 * INTERVAL_S,
        0.7 * antenna[row] + 0.3 * antenna[row + 1],
        np.full(n, 0.1),
        np.full(n, 0.1),
        correlation_s=np.full(n, 10.0),
    )
    for array in (poses, t_s, *vars(problem).values(), *vars(fixes).values()):
        if isinstance(array, np.ndarray):
            array.setflags(write=False)
    return problem, poses, t_s, fixes


def no_positions(ids):
    """Positions that take those of features (n,) away."""
    return Positions(ids, np.full((len(ids), 3), np.nan), np.full(len(ids), np.nan))


def away(poses, true):
    """Mean distance of the camera centres."""
    return float(np.linalg.norm(poses[:, :3, 3] - true[:, :3, 3], axis=1).mean())

"""KITTI odometry poses: the first three rows of world_T_camera, twelve numbers a line."""

from pathlib import Path

import numpy as np

from vgps.solution import Solution


def write_kitti(solution: Solution, out: Path) -> None:
    """Write a line per frame; the world is ENU, not the first camera."""
    np.savetxt(out, solution.world_T_camera[:, :3].reshape(-1, 12) + 0.0, fmt="%.12g")

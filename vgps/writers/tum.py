"""Trajectories in the TUM format: a line ``t_s x y z qx qy qz qw`` per frame."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.model import FloatArray
from vgps.solution import Trajectory

HEADER = "t_s x y z qx qy qz qw  (world_T_camera, world is ENU in metres; camera x right, y down, z forward)"


def write_tum(trajectory: Trajectory, out: Path, header: str = HEADER) -> None:
    """Write world_T_camera as TUM: nanoseconds, nanometres, and quaternions (w last, w >= 0) to 1e-12."""
    position = trajectory.world_T_camera[:, :3, 3]
    rows = np.column_stack([trajectory.t_s, position, quaternion(trajectory.world_T_camera)])
    np.savetxt(out, rows + 0.0, fmt=["%.9f"] * 4 + ["%.12f"] * 4, header=header, encoding="utf-8")


def quaternion(world_T_camera: FloatArray) -> FloatArray:
    """Return (N, 4) quaternions x, y, z, w of (N, 4, 4) poses, with w >= 0."""
    if len(world_T_camera) == 0:
        return np.empty((0, 4))
    return Rotation.from_matrix(world_T_camera[:, :3, :3]).as_quat(canonical=True)

"""Poses as KITTI odometry writes them: the first three rows of world_T_camera, twelve numbers a line."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.errors import TrajectoryError
from vgps.model import FloatArray
from vgps.readers.table import read_bytes

_COLUMNS = 12
_ORTHOGONAL = 1e-2  # largest error of an entry of R^T R; KITTI's files have six digits


def read_kitti_poses(path: Path) -> FloatArray:
    """Return world_T_camera (N, 4, 4) of a file of KITTI odometry; its world is usually the first camera.

    Raises:
        TrajectoryError: The file is missing or empty, or a line is not a pose.
    """
    text = read_bytes(path, TrajectoryError).decode("utf-8-sig", errors="replace")
    rows = [_row(line, path, number) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = np.array(rows).reshape(-1, 3, 4)
    poses[:, :3, :3] = Rotation.from_matrix(poses[:, :3, :3]).as_matrix()
    return poses


def _row(line: str, path: Path, number: int) -> list[float]:
    try:
        row = [float(cell) for cell in line.split()]
    except ValueError:
        row = []
    if len(row) == _COLUMNS and np.isfinite(row).all():
        R = np.array(row).reshape(3, 4)[:, :3]
        if np.abs(R.T @ R - np.eye(3)).max() < _ORTHOGONAL and np.linalg.det(R) > 0:
            return row
    raise TrajectoryError(
        f"{line.strip()[:60]!r}",
        file=path,
        place=f"line {number}",
        expected="the first three rows of world_T_camera, twelve numbers",
    )

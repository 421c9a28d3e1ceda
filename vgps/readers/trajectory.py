"""Trajectories in TUM's format: ``t_s x y z qx qy qz qw``, world_T_camera."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.errors import TrajectoryError
from vgps.readers.table import first_unordered, read_bytes
from vgps.solution import Trajectory

_COLUMNS = 8


def read_trajectory(path: str | Path, *, video_start_s: float = 0.0) -> Trajectory:
    """Read ``truth.tum`` or ``poses.tum``; quaternions are normalised.

    Args:
        path: The file; ``#`` starts a comment, blanks or commas separate numbers.
        video_start_s: The first frame's time on the file's clock; subtracted.

    Raises:
        TrajectoryError: The file is missing or empty, a line is not a pose, or a time does not increase.
    """
    path = Path(path)
    text = read_bytes(path, TrajectoryError).decode("utf-8-sig", errors="replace")
    rows, lines = [], []
    for number, line in enumerate(text.splitlines(), 1):
        content = line.split("#")[0].strip()
        if content:
            rows.append(_row(content, path, number))
            lines.append(number)
    if not rows:
        raise TrajectoryError("no poses", file=path, expected="lines of t_s x y z qx qy qz qw")
    table = np.array(rows)
    row = first_unordered(table[:, 0])
    if row is not None:
        raise TrajectoryError(
            f"time {table[row, 0]:g}",
            file=path,
            place=f"line {lines[row]}",
            expected="one later than the last",
        )
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(table[:, 4:]).as_matrix()
    poses[:, :3, 3] = table[:, 1:4]
    return Trajectory(table[:, 0] - video_start_s, poses)


def _row(content: str, path: Path, number: int) -> list[float]:
    try:
        row = [float(cell) for cell in content.replace(",", " ").split()]
    except ValueError:
        row = []
    if len(row) != _COLUMNS or not np.isfinite(row).all() or not 1e-6 < max(map(abs, row[4:])) < 1e6:
        raise TrajectoryError(
            f"{content[:60]!r}", file=path, place=f"line {number}", expected="t_s x y z qx qy qz qw"
        )
    return row

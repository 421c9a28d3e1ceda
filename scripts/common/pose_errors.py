"""Errors of poses against true ones, unaligned."""

import numpy as np

from vgps.geometry import rotation_vectors
from vgps.model import FloatArray


def pose_errors(poses: FloatArray, true: FloatArray) -> dict[str, float]:
    """Return errors of the poses (F, 4, 4) that there are, against the true ones."""
    posed = np.isfinite(poses[:, 0, 3])
    if not posed.any():
        return dict.fromkeys(("mean_m", "max_m", "rotation_deg", "rotation_max_deg"), np.nan)
    poses, true = poses[posed], true[posed]
    away = np.linalg.norm(poses[:, :3, 3] - true[:, :3, 3], axis=1)
    turn = rotation_vectors(poses[:, :3, :3] @ true[:, :3, :3].transpose(0, 2, 1))
    turn_deg = np.degrees(np.linalg.norm(turn, axis=1))
    return {
        "mean_m": float(away.mean()),
        "max_m": float(away.max()),
        "rotation_deg": float(turn_deg.mean()),
        "rotation_max_deg": float(turn_deg.max()),
    }

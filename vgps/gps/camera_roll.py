"""How a camera is turned about its axis of view, by a path on which it was posed."""

import numpy as np

from vgps.config import StartConfig
from vgps.solution import Trajectory

OR_MIRRORED = ". A mirrored picture would look the same, and get wrong rotations and heights"
_LEVEL_VIEW = 0.5  # sine of the angle to the vertical of a camera that looks ahead or aside


def camera_roll_deg(path: Trajectory, start: StartConfig) -> float | None:
    """Return the angle (-180 to 180) by which a camera is turned clockwise against what was assumed.

    Args:
        path: Level.
        start: How the camera was assumed to be turned.

    Returns:
        None for a camera that flies or looks down, which may be turned anyhow.
    """
    right_z, down_z, _ = np.median((path.world_T_camera[:, :3, :3] @ start.upright)[:, 2], axis=0)
    if start.flies or np.hypot(right_z, down_z) < _LEVEL_VIEW:
        return None
    return float(np.degrees(np.arctan2(-right_z, -down_z)))


def camera_turned_deg(path: Trajectory, start: StartConfig, *, upside_down: bool) -> float:
    """Return by how much a camera is turned clockwise against what was assumed, 0, 90, 180 or 270 degrees.

    Args:
        path: Level; one whose camera is turned by a quarter may have found out by itself.
        start: How the camera was assumed to be turned.
        upside_down: Whether above is below on that path.
    """
    roll_deg = camera_roll_deg(path, start)
    return 0.0 if roll_deg is None else 90.0 * ((round(roll_deg / 90.0) + 2 * upside_down) % 4)

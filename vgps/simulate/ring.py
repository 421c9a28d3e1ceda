"""Rigs of several cameras: a ring that looks outwards, as the lenses of a 360 degree camera do."""

import numpy as np

from vgps.model import FloatArray

MAX_CAMERAS = 6
_RADIUS_M = 0.1


def ring(cameras: int) -> dict[str, FloatArray]:
    """Return reference_T_camera (4, 4) of all cameras but the first, by name, at equal angles about y."""
    mounts = {}
    for k in range(1, cameras):
        angle = 2 * np.pi * k / cameras
        c, s = np.cos(angle), np.sin(angle)
        mount = np.eye(4)
        mount[:3, :3] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
        mount[:3, 3] = _RADIUS_M * (mount[:3, 2] - np.array([0.0, 0.0, 1.0]))
        mounts[f"camera_{k + 1}"] = mount
    return mounts

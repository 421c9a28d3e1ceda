"""A smooth pose that approaches the corrected pose at a limited speed instead of jumping to it."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import OnlineConfig
from vgps.model import FloatArray


class Blender:
    """Smooth poses: the corrected poses plus an offset left by corrections, which decays.

    The offset's length decays by ``exp(-dt / blend_s)``, but by no more than ``blend_m_s * dt`` and
    ``blend_deg_s * dt``.
    """

    def __init__(self, config: OnlineConfig) -> None:
        self._config = config
        self._shift = np.zeros(3)
        self._rotation = np.zeros(3)

    def reset(self) -> None:
        """Drop the offset, for a pose without a predecessor."""
        self._shift, self._rotation = np.zeros(3), np.zeros(3)

    def correct(self, before: FloatArray, now: FloatArray) -> None:
        """Account for a correction of the last frame's pose (4, 4); its smooth pose does not change."""
        rotated = Rotation.from_rotvec(self._rotation) * Rotation.from_matrix(before[:3, :3])
        self._rotation = (rotated * Rotation.from_matrix(now[:3, :3]).inv()).as_rotvec()
        self._shift = self._shift + before[:3, 3] - now[:3, 3]

    def advance(self, world_T_camera: FloatArray, interval_s: float) -> FloatArray:
        """Return the smooth pose (4, 4) of the next frame.

        Args:
            world_T_camera: (4, 4) its corrected pose.
            interval_s: Time since the previous frame.
        """
        config = self._config
        self._shift = _decayed(self._shift, interval_s, config.blend_s, config.blend_m_s)
        limit_rad_s = float(np.radians(config.blend_deg_s))
        self._rotation = _decayed(self._rotation, interval_s, config.blend_s, limit_rad_s)
        smooth = world_T_camera.copy()
        smooth[:3, 3] += self._shift
        smooth[:3, :3] = Rotation.from_rotvec(self._rotation).as_matrix() @ world_T_camera[:3, :3]
        return smooth


def _decayed(offset: FloatArray, interval_s: float, time_s: float, max_per_s: float) -> FloatArray:
    length = float(np.linalg.norm(offset))
    if length < 1e-12:
        return np.zeros(3)
    step = min(length * (1.0 - np.exp(-interval_s / time_s)), max_per_s * interval_s)
    return np.asarray(offset * (1.0 - step / length))

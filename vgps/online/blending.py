"""A pose without jumps beside one that is corrected: it nears the corrected one at a limited speed."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import OnlineConfig
from vgps.model import FloatArray


class Blender:
    """Moves as the corrected poses move, while the offset from them that a correction left fades away.

    The offset's length decays by ``exp(-dt / blend_s)``, but by no more than ``blend_m_s * dt`` and
    ``blend_deg_s * dt``.
    """

    def __init__(self, config: OnlineConfig) -> None:
        self._config = config
        self._shift = np.zeros(3)
        self._turn = np.zeros(3)

    def begin(self) -> None:
        """From here on there is nothing to be smooth with."""
        self._shift, self._turn = np.zeros(3), np.zeros(3)

    def corrected(self, before: FloatArray, now: FloatArray) -> None:
        """The corrected pose (4, 4) of the last frame is another one now; its smooth pose stays."""
        turned = Rotation.from_rotvec(self._turn) * Rotation.from_matrix(before[:3, :3])
        self._turn = (turned * Rotation.from_matrix(now[:3, :3]).inv()).as_rotvec()
        self._shift = self._shift + before[:3, 3] - now[:3, 3]

    def advance(self, world_T_camera: FloatArray, interval_s: float) -> FloatArray:
        """The smooth pose (4, 4) of the next frame, ``interval_s`` after the last.

        Args:
            world_T_camera: (4, 4) its corrected pose.
            interval_s: Since the frame before.
        """
        config = self._config
        self._shift = _faded(self._shift, interval_s, config.blend_s, config.blend_m_s)
        self._turn = _faded(self._turn, interval_s, config.blend_s, float(np.radians(config.blend_deg_s)))
        smooth = world_T_camera.copy()
        smooth[:3, 3] += self._shift
        smooth[:3, :3] = Rotation.from_rotvec(self._turn).as_matrix() @ world_T_camera[:3, :3]
        return smooth


def _faded(offset: FloatArray, interval_s: float, time_s: float, most_per_s: float) -> FloatArray:
    length = float(np.linalg.norm(offset))
    if length < 1e-12:
        return np.zeros(3)
    step = min(length * (1.0 - np.exp(-interval_s / time_s)), most_per_s * interval_s)
    return np.asarray(offset * (1.0 - step / length))

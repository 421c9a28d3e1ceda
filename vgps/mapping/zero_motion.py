"""What holds a frame that stands still: its pose relative to a frame that has observations."""

from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray


@dataclass(frozen=True)
class ZeroMotion:
    """A frame that shows no motion against ``key``: its relative pose instead of observations of its own.

    ``key_T_frame`` (4, 4) and the standard deviations (6,) [rotation rad; translation in map units].
    """

    frame: int
    key: int
    key_T_frame: FloatArray
    sigma: FloatArray

    def scaled(self, scale: float) -> "ZeroMotion":
        """In a unit ``scale`` times smaller."""
        sigma = np.concatenate([self.sigma[:3], scale * self.sigma[3:]])
        return ZeroMotion(self.frame, self.key, scaled_pose(self.key_T_frame, scale), sigma)


def scaled_pose(pose: FloatArray, scale: float) -> FloatArray:
    """A relative pose (4, 4) in a unit ``scale`` times smaller."""
    out = pose.copy()
    out[:3, 3] *= scale
    return out

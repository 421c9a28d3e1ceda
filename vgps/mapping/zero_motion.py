"""Zero-motion constraints of frames in which the camera stands still."""

from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray


@dataclass(frozen=True)
class ZeroMotion:
    """Pose of a standing frame relative to ``reference``, a frame with observations; it has none itself.

    ``reference_T_frame`` (4, 4) with standard deviations (6,) [rotation rad; translation in map units].
    """

    frame: int
    reference: int
    reference_T_frame: FloatArray
    sigma: FloatArray

    def scaled(self, scale: float) -> "ZeroMotion":
        """Return the constraint in a map unit ``scale`` times smaller."""
        sigma = np.concatenate([self.sigma[:3], scale * self.sigma[3:]])
        return ZeroMotion(self.frame, self.reference, scaled_pose(self.reference_T_frame, scale), sigma)


def scaled_pose(pose: FloatArray, scale: float) -> FloatArray:
    """Return a relative pose (4, 4) in a unit ``scale`` times smaller."""
    out = pose.copy()
    out[:3, 3] *= scale
    return out

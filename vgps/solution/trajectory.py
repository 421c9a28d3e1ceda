"""Where the camera was, and how that is known."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from vgps.model import FloatArray


@dataclass(frozen=True)
class Trajectory:
    """Poses over time: ``t_s`` (N,), ``world_T_camera`` (N, 4, 4)."""

    t_s: FloatArray
    world_T_camera: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def length_m(self) -> float:
        """Length of the path from frame to frame."""
        return float(np.linalg.norm(np.diff(self.world_T_camera[:, :3, 3], axis=0), axis=1).sum())


class FrameState(StrEnum):
    """How the pose of a frame was obtained."""

    TRACKED = "tracked"  # from features observed in it
    BRIDGED = "bridged"  # no usable features: from neighbouring frames and nearby fixes

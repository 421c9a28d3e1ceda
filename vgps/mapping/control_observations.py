"""Observations of points whose place in the world is known."""

from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray, IntArray


@dataclass(frozen=True)
class ControlObservations:
    """Observations of known points: ``frame`` (N,), ``uv_px`` (N, 2) undistorted, ``world_p_point`` (N,
    3)."""

    frame: IntArray
    uv_px: FloatArray
    world_p_point: FloatArray

    def between(self, first: int, last: int) -> "ControlObservations":
        """Those in frames ``first`` to ``last``, frames counted from ``first``."""
        rows = (self.frame >= first) & (self.frame <= last)
        return ControlObservations(self.frame[rows] - first, self.uv_px[rows], self.world_p_point[rows])


NO_CONTROL_OBSERVATIONS = ControlObservations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 3)))

"""Observations of control points: points of known position in the world."""

from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray, IntArray


@dataclass(frozen=True)
class ControlObservations:
    """Control points ``world_p_point`` (N, 3) observed in ``frame`` (N,) at ``uv_px`` (N, 2), undistorted.

    ``sigma_m`` (N, 3) are the standard deviations of the position times the root of the number of
    observations of the same point, which share its error: together they weigh as much as it is known.
    """

    frame: IntArray
    uv_px: FloatArray
    world_p_point: FloatArray
    sigma_m: FloatArray

    def between(self, first: int, last: int) -> "ControlObservations":
        """Return the observations in frames ``first`` to ``last``, frames counted from ``first``."""
        rows = (self.frame >= first) & (self.frame <= last)
        return ControlObservations(
            self.frame[rows] - first, self.uv_px[rows], self.world_p_point[rows], self.sigma_m[rows]
        )


NO_CONTROL_OBSERVATIONS = ControlObservations(
    np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 3)), np.zeros((0, 3))
)

"""Observations of a rolling shutter: each belongs to the time of its row on the path through the frames."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from factors import knots_around, path_poses, path_vectors, path_weights
from vgps.model import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class RowTimes:
    """When the rows of observations were exposed, and the frames through which the path is drawn there.

    Attributes:
        readout_s: Time from the first row to the last.
        share: (N,) place of each observation's row, from -1/2 (first row) to 1/2 (last row).
        frame_s: (N,) time of its frame, that of the middle row.
        knots: (N, k) frames of the path's polynomial, one after the other.
        knot_s: (N, k) their times.
    """

    readout_s: float
    share: FloatArray
    frame_s: FloatArray
    knots: IntArray
    knot_s: FloatArray

    @classmethod
    def of_frames(cls, t_s: FloatArray, frame: IntArray, share: FloatArray, readout_s: float) -> "RowTimes":
        """Return the times of observations in frames (N,) with times ``t_s`` (F,); other arguments as above.

        A readout that is still to be estimated counts as positive.
        """
        later = share * (readout_s or 1.0) >= 0.0
        knots = knots_around(t_s, frame - np.where(later, 0, 1))
        return cls(readout_s=readout_s, share=share, frame_s=t_s[frame], knots=knots, knot_s=t_s[knots])

    def rows(self, rows: IntArray) -> "RowTimes":
        """Return the times of some observations."""
        return replace(
            self,
            share=self.share[rows],
            frame_s=self.frame_s[rows],
            knots=self.knots[rows],
            knot_s=self.knot_s[rows],
        )

    @cached_property
    def _weights(self) -> tuple[FloatArray, FloatArray]:
        return path_weights(self.knot_s, self.frame_s + self.readout_s * self.share)

    @property
    def weights(self) -> FloatArray:
        """(N, k) weights of the knots."""
        return self._weights[0]

    @cached_property
    def first(self) -> int:
        """The first knot of all; 0 without observations."""
        return int(self.knots.min()) if len(self.knots) else 0

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """(N, frames) weights of the frames from the first knot to the last."""
        return self._sparse(self.weights)

    @cached_property
    def by_readout(self) -> sparse.csr_array:
        """(N, frames) derivatives of the weights by the readout, 1/s."""
        return self._sparse(self._weights[1] * self.share[:, None])

    def vectors(self, world_T_camera: FloatArray) -> FloatArray:
        """Return the vectors (frames, 7) of the frames from the first knot to the last."""
        return path_vectors(world_T_camera[self.first : self.first + self.matrix.shape[1]])

    def poses(self, world_T_camera: FloatArray) -> FloatArray:
        """Return the pose (N, 4, 4) of each row."""
        return path_poses(self.matrix @ self.vectors(world_T_camera))

    def _sparse(self, values: FloatArray) -> sparse.csr_array:
        n, k = self.knots.shape
        count = int(self.knots.max(initial=-1)) + 1 - self.first
        index = ((self.knots - self.first).ravel(), k * np.arange(n + 1))
        return sparse.csr_array((values.ravel(), *index), shape=(n, count))

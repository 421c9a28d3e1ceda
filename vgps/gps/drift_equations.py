"""A Gauss-Newton step of the drift model, at a cost that is linear in the number of knots.

A fix depends on the drift of all steps before it, so normal equations in the drift alone are dense. With the
position at every knot as an unknown of its own it depends on the two knots around it. What ties positions to
drifts, ``p_k+1 = p_k + A_k (d_k, d_k+1)``, is then a constraint with a Lagrange multiplier, and the system is
banded: the step is that of the dense equations.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import solve_banded

from vgps.geometry import cross_matrices
from vgps.model import FloatArray, IntArray

DRIFT_DIM = 4  # log scale and rotation vector
INTERVAL_DIM = 11  # unknowns of an interval between knots
POSITION, DRIFTS = slice(0, 3), slice(3, 11)  # among them: at its start; of the knots before and after it
_KNOT = 10  # unknowns of a knot: position, drift, multiplier
_BAND = 16  # from the position of one knot to the last drift of the next
_OF_INTERVAL = np.array([0, 1, 2, 3, 4, 5, 6, 13, 14, 15, 16])  # its unknowns among those of two knots
_MULTIPLIER = np.array([7, 8, 9])
_NEXT_POSITION = np.array([10, 11, 12])
_DAMPING = 1e-9  # of what no fix determines


class KnotIntervals:
    """Frames between knots at equal distances.

    Attributes:
        spacing: Frames, not an integer, from knot to knot.
        of_frame: (F,) interval that each frame is in.
        share: (F,) weight of the knot after it; the one before it has the rest.
    """

    def __init__(self, frames: int, knots: int) -> None:
        at = np.linspace(0, frames - 1, knots)
        self.spacing = float(at[1] - at[0])
        self.of_frame: IntArray = np.searchsorted(at[1:-1], np.arange(frames), side="right")
        self.share: FloatArray = (np.arange(frames) - at[self.of_frame]) / self.spacing
        # (K,) first frame of each interval, and the last frame of all
        self._first = np.append(np.searchsorted(self.of_frame, np.arange(knots - 1)), frames - 1)

    def at_frames(self, drift: FloatArray) -> FloatArray:
        """Return the drift (F, 4), interpolated between that of the knots (K, 4)."""
        share = self.share[:, None]
        return np.asarray((1.0 - share) * drift[self.of_frame] + share * drift[self.of_frame + 1])

    def derivatives(self, steps: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how positions follow the drifts (8,) of the knots before and after them.

        Args:
            steps: (F - 1, 3) steps of the corrected path, metres.

        Returns:
            Derivatives of each step (F - 1, 3, 8), of the displacement from the start of its interval to each
            frame (F, 3, 8), and of that across each interval (K - 1, 3, 8).
        """
        # by log scale the step itself, by a rotation w: w x step
        by_drift = np.concatenate([steps[:, :, None], -cross_matrices(steps)], axis=2)
        share = self.share[:-1, None, None]
        by_step = np.concatenate([(1.0 - share) * by_drift, share * by_drift], axis=2)
        total = np.concatenate([np.zeros((1, 3, 2 * DRIFT_DIM)), np.cumsum(by_step, axis=0)])
        at_knots = total[self._first]
        return by_step, total - at_knots[self.of_frame], np.diff(at_knots, axis=0)


@dataclass(frozen=True, kw_only=True)
class DriftEquations:
    """Least squares of fixes and drift.

    Attributes:
        interval: (M,) interval of each fix.
        J: (M, 3, 11) whitened Jacobians by its start's position and the drifts before and after it.
        J_time: (M, 3) by the time offset.
        r: (M, 3) whitened residuals.
        across: (K - 1, 3, 8) displacement across each interval by the drifts before and after it.
    """

    interval: IntArray
    J: FloatArray
    J_time: FloatArray
    r: FloatArray
    across: FloatArray

    def step(
        self, hessian: FloatArray, gradient: FloatArray, time_prior: tuple[float, float] | None
    ) -> tuple[FloatArray, float]:
        """Return the step of the intervals' unknowns (K - 1, 11), and that of the time offset.

        Args:
            hessian: (K - 1, 11, 11) of the priors.
            gradient: (K - 1, 11) of the priors.
            time_prior: The same two of the time offset, which is held without them.
        """
        columns = self.J.swapaxes(1, 2)  # (M, 11, 3)
        whole = np.concatenate([self.J, self.r[:, :, None], self.J_time[:, :, None]], axis=2)
        sums = self._sums(columns @ whole)
        hessian = hessian + sums[:, :, :INTERVAL_DIM]
        gradient, by_time = gradient + sums[:, :, INTERVAL_DIM], sums[:, :, INTERVAL_DIM + 1]
        solution = self._solve(hessian, np.stack([gradient, by_time], axis=2))
        if time_prior is None:
            return -solution[:, :, 0], 0.0
        information = (1.0 + _DAMPING) * (time_prior[0] + np.sum(self.J_time**2)) + _DAMPING
        toward = time_prior[1] + np.sum(self.J_time * self.r) - np.sum(by_time * solution[:, :, 0])
        time_step = -float(toward / (information - np.sum(by_time * solution[:, :, 1])))
        return -solution[:, :, 0] - time_step * solution[:, :, 1], time_step

    def _sums(self, values: FloatArray) -> FloatArray:
        """Return sums (K - 1, ...) over the fixes (M, ...) of each interval."""
        count = len(values)
        entries = np.ones(count), self.interval, np.arange(count + 1)  # a column for each fix
        sums = sparse.csc_array(entries, shape=(len(self.across), count)) @ values.reshape(count, -1)
        return np.asarray(sums).reshape(-1, *values.shape[1:])

    def _solve(self, hessian: FloatArray, right: FloatArray) -> FloatArray:
        """Return the solutions (K - 1, 11, k) for right sides (K - 1, 11, k) under the constraints."""
        intervals, size = len(self.across), _KNOT * (len(self.across) + 1)
        blocks = np.zeros((intervals, _BAND + 1, _BAND + 1))
        blocks[:, _OF_INTERVAL[:, None], _OF_INTERVAL] = hessian
        constraint = np.zeros((intervals, 3, _BAND + 1))
        constraint[:, :, _OF_INTERVAL[POSITION]] = np.eye(3)
        constraint[:, :, _OF_INTERVAL[DRIFTS]] = self.across
        constraint[:, :, _NEXT_POSITION] = -np.eye(3)
        blocks[:, _MULTIPLIER] = constraint
        blocks[:, :, _MULTIPLIER] = constraint.swapaxes(1, 2)
        at = _KNOT * np.arange(intervals)[:, None]
        row, column = np.indices(blocks.shape[1:]).reshape(2, -1)
        band = np.zeros((2 * _BAND + 1, size))
        np.add.at(band, (_BAND + row - column, at + column), blocks.reshape(intervals, -1))
        diagonal = band[_BAND].reshape(-1, _KNOT)
        diagonal[-1, _MULTIPLIER] = 1.0  # the last knot has none
        damped = diagonal[:, : _MULTIPLIER[0]]
        damped[0] += _DAMPING * (1.0 + damped[0])
        damped[1:, 3:] += _DAMPING * (1.0 + damped[1:, 3:])
        vector = np.zeros((size, right.shape[2]))
        np.add.at(vector, at + _OF_INTERVAL, right)
        return np.asarray(solve_banded((_BAND, _BAND), band, vector, overwrite_ab=True)[at + _OF_INTERVAL])

"""Steps of the error from fix to fix: what no path that fits the video explains.

An RTK receiver that settles on wrong integers is off by decimetres for seconds to minutes, without reporting
it. Between neighbouring fixes the video is more accurate. Each hypothesis is a shift that the fixes of a run
have in common (detection, identification and adaptation of biases; Teunissen, Quality control in integrated
navigation systems, 1990): with it the least-squares cost falls, by more than regions explain.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgps.model import FloatArray, IntArray

_WEAK = 1e-6  # relative: what nearly no observation determines


@dataclass(frozen=True)
class FixErrorEquations:
    """Normal equations of errors (3,), one of each of n fixes, in a least-squares fit to them and the video.

    Attributes:
        information: (n, 3, n, 3) of the errors, metres^-2.
        gradient: (n, 3) of half the squared residuals by the errors, at zero, metres^-1.
    """

    information: FloatArray
    gradient: FloatArray

    def without(self, directions: FloatArray, information: FloatArray | float = 0.0) -> "FixErrorEquations":
        """Return it with combinations of errors taken as unknown.

        Args:
            directions: (n, 3, k) errors of the fixes by k unknowns.
            information: (k,) what is known of these.
        """
        U, M = self._flat(directions)
        gain = self._solved(U, U.T @ M, information)
        left = M - M @ U @ gain
        gradient = self.gradient.ravel() - gain.T @ (U.T @ self.gradient.ravel())
        return FixErrorEquations(left.reshape(self.information.shape), gradient.reshape(-1, 3))

    def errors(self, directions: FloatArray) -> FloatArray:
        """Return the combination (n, 3) of errors (n, 3, k) that costs least."""
        U, _ = self._flat(directions)
        return np.asarray((U @ self._solved(U, -U.T @ self.gradient.ravel())).reshape(-1, 3))

    def _flat(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        size = 3 * len(self.gradient)
        return directions.reshape(size, -1), self.information.reshape(size, size)

    def _solved(self, U: FloatArray, right: FloatArray, information: FloatArray | float = 0.0) -> FloatArray:
        """Return the solution of the normal equations of k unknowns, by which errors are U (3 n, k)."""
        _, M = self._flat(U)
        normal = U.T @ M @ U + np.diag(np.broadcast_to(information, U.shape[1]))
        normal[np.diag_indices(len(normal))] *= 1.0 + _WEAK
        return np.asarray(np.linalg.solve(normal, right), np.float64)


class _Run(NamedTuple):
    """Fixes ``begin`` to ``end`` (exclusive) share an error, which lowers the cost by ``gain`` more than
    their regions explain."""

    begin: int
    end: int
    gain: float


def error_steps(equations: FixErrorEquations, tolerance_m: FloatArray, least_gain: float) -> FloatArray:
    """Return the steps (n, 3) [m] of the error to each fix from the one before; zero where none is certain.

    Runs of fixes that share an error are found one after the other, the most certain one first; then the
    errors of all are estimated together.

    Args:
        equations: Of n fixes in order of time.
        tolerance_m: (n - 1, 2) in the plane and in height: differences between neighbours that are no error.
        least_gain: Least gain of a run.
    """
    n = len(equations.gradient)
    runs: list[FloatArray] = []
    left = equations
    while len(runs) < n // 2:
        run = _likeliest_run(left, tolerance_m)
        if run.gain < least_gain:
            break
        runs.append(_shared_by(n, run.begin, run.end))
        left = left.without(runs[-1])
    error = equations.errors(np.concatenate(runs, axis=2)) if runs else np.zeros((n, 3))
    return np.diff(error, axis=0, prepend=error[:1])


def _shared_by(n: int, begin: int, end: int) -> FloatArray:
    """Return the derivatives (n, 3, 3) of the errors of n fixes by one that a run shares."""
    run = np.zeros((n, 3, 3))
    run[begin:end] = np.eye(3)
    return run


def _likeliest_run(equations: FixErrorEquations, tolerance_m: FloatArray) -> _Run:
    """Return the run of at most half the fixes whose shared error lowers the cost most."""
    begin, end = _runs(len(equations.gradient))
    information, gradient = _sums(equations, begin, end)
    information = information + _WEAK * np.trace(information, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    shift = -np.linalg.solve(information, gradient[:, :, None])[:, :, 0]
    gain = -0.5 * np.sum(shift * gradient, axis=1)
    edges = np.concatenate([np.zeros((1, 2)), tolerance_m, np.zeros((1, 2))])
    allowed = np.maximum(edges[begin], edges[end])
    size = np.stack([np.hypot(shift[:, 0], shift[:, 1]), np.abs(shift[:, 2])], axis=1)
    within = np.min(allowed / np.maximum(size, 1e-9), axis=1).clip(max=1.0)
    gain = gain * (1.0 - within) ** 2
    k = int(np.argmax(gain))
    return _Run(int(begin[k]), int(end[k]), float(gain[k]))


def _runs(n: int) -> tuple[IntArray, IntArray]:
    """Return the begins and ends of all runs of 1 to n // 2 of n fixes."""
    begin, end = np.triu_indices(n + 1, 1)
    rows = end - begin <= n // 2
    return begin[rows], end[rows]


def _sums(equations: FixErrorEquations, begin: IntArray, end: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return information (R, 3, 3) and gradient (R, 3) of a common shift of each run."""
    n = len(equations.gradient)
    total = np.zeros((n + 1, 3, n + 1, 3))
    total[1:, :, 1:] = equations.information.cumsum(axis=0).cumsum(axis=2)
    gradient = np.concatenate([np.zeros((1, 3)), equations.gradient.cumsum(axis=0)])

    def corner(a: IntArray, b: IntArray) -> FloatArray:
        return np.asarray(total[a, :, b])

    both = corner(end, end) - corner(end, begin) - corner(begin, end) + corner(begin, begin)
    return both, gradient[end] - gradient[begin]

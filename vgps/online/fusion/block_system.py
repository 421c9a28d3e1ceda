"""Normal equations of a chain of nodes, whose matrix is block tridiagonal."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs, dtbtrs

from vgps.model import FloatArray, IntArray

_RIDGE = 1e-8  # keeps solvable what nothing determines


@dataclass(frozen=True)
class BlockSystem:
    """Normal equations: blocks (N, n, n) of the diagonal and (N - 1, n, n) below it, gradient (N, n)."""

    diagonal: FloatArray
    below: FloatArray
    gradient: FloatArray

    @cached_property
    def _factor(self) -> FloatArray:
        """Cholesky factor in LAPACK's lower band storage."""
        count, n, _ = self.diagonal.shape
        columns = np.zeros((count, 3 * n, n))
        columns[:, :n], columns[:-1, n : 2 * n] = self.diagonal, self.below
        column = np.arange(n)
        band = columns[:, column + np.arange(2 * n)[:, None], column].transpose(1, 0, 2).reshape(2 * n, -1)
        # LAPACK itself: SciPy's checks take longer than so small a system
        factor, failed = dpbtrf(band, lower=True)
        if failed:
            raise np.linalg.LinAlgError("the normal equations are not positive definite")
        return np.asarray(factor)

    def step(self) -> FloatArray:
        """Return the increments (N, n) that solve them."""
        step, _ = dpbtrs(self._factor, -self.gradient.ravel(), lower=True)
        return np.asarray(step.reshape(self.gradient.shape))

    def last_covariance(self) -> FloatArray:
        """Return the covariance (n, n) of the last node, whose Schur complement ends the factor."""
        inverse = np.linalg.inv(self._last_block)
        return np.asarray(inverse.T @ inverse)

    @property
    def _last_block(self) -> FloatArray:
        """Rows and columns (n, n) of the last node in the factor."""
        n = self.diagonal.shape[1]
        row = np.arange(n)[:, None]
        return np.asarray(np.tril(self._factor[row - np.arange(n), np.arange(-n, 0)]))

    @cached_property
    def _inverse(self) -> tuple[FloatArray, FloatArray]:
        """Blocks (N, n, n) on, and (N - 1, n, n) below, the diagonal of the inverse.

        By elimination forwards and substitution back.
        """
        out, cross = np.empty_like(self.diagonal), np.empty_like(self.below)
        information, gains = self.diagonal[0], []
        for k, below in enumerate(self.below):
            out[k] = np.linalg.inv(information)
            gains.append(below @ out[k])
            information = self.diagonal[k + 1] - gains[k] @ below.T
        out[-1] = np.linalg.inv(information)
        for k in range(len(gains) - 1, -1, -1):
            cross[k] = -out[k + 1] @ gains[k]
            out[k] -= gains[k].T @ cross[k]
        return out, cross

    def covariances(self) -> FloatArray:
        """Return the covariances (N, n, n) of all nodes."""
        return self._inverse[0]

    def change_covariances(self) -> FloatArray:
        """Return the covariances (N - 1, n, n) of the change from each node to the next."""
        each, cross = self._inverse
        return np.asarray(each[1:] + each[:-1] - cross - cross.transpose(0, 2, 1))

    def eliminated(self) -> tuple[FloatArray, FloatArray]:
        """Return information (n, n) and vector (n,) of the last node with all others eliminated."""
        n, last = self.diagonal.shape[1], self._last_block
        carried, _ = dtbtrs(self._factor, self.gradient.reshape(-1, 1), uplo="L")
        return last @ last.T, last @ carried[-n:, 0]


class BlockSum:
    """Normal equations of N nodes with n unknowns each, as they are summed."""

    def __init__(self, count: int, unknowns: int) -> None:
        self.diagonal = np.tile(_RIDGE * np.eye(unknowns), (count, 1, 1))
        self.below = np.zeros((count - 1, unknowns, unknowns))
        self.gradient = np.zeros((count, unknowns))

    def add_between(self, before: FloatArray, after: FloatArray, W: FloatArray, r: FloatArray) -> None:
        """Add residuals r (N - 1, m) with information W (N - 1, m, m) and derivatives (N - 1, m, n)."""
        B, A = before.transpose(0, 2, 1) @ W, after.transpose(0, 2, 1) @ W
        self.diagonal[:-1] += B @ before
        self.diagonal[1:] += A @ after
        self.below += A @ before
        self.gradient[:-1] += (B @ r[:, :, None])[:, :, 0]
        self.gradient[1:] += (A @ r[:, :, None])[:, :, 0]

    def add_changes(self, w: FloatArray, change: FloatArray) -> None:
        """Add changes (N - 1, m) of the last m unknowns from node to node with weights w (N - 1, m)."""
        last = np.arange(self.gradient.shape[1] - w.shape[1], self.gradient.shape[1])
        self.diagonal[:-1, last, last] += w
        self.diagonal[1:, last, last] += w
        self.below[:, last, last] -= w
        self.gradient[:-1, last] -= w * change
        self.gradient[1:, last] += w * change

    def add_each(self, J: FloatArray, w: FloatArray, r: FloatArray, node: IntArray) -> None:
        """Add residuals r (M, m) of nodes (M,) with weights w (M, m) and derivatives J (M, m, n)."""
        order = np.argsort(node, kind="stable")
        first = np.flatnonzero(np.diff(node[order], prepend=-1))
        weighted = (J.transpose(0, 2, 1) * w[:, None, :])[order]
        self.diagonal[node[order][first]] += np.add.reduceat(weighted @ J[order], first)
        self.gradient[node[order][first]] += np.add.reduceat((weighted @ r[order, :, None])[:, :, 0], first)

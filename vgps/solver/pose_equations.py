"""Normal equations of the factors on poses, which GTSAM linearises, and of what all frames share."""

from dataclasses import dataclass

import gtsam
import numpy as np
from scipy import sparse

from vgps.model import FloatArray, IntArray
from vgps.solver.band_matrix import POSE
from vgps.solver.elimination import Matrix, Structure
from vgps.solver.problem import BundleProblem

MIN_DIAGONAL = 1e-6  # damped at least as if the diagonal were this, GTSAM's default


@dataclass(frozen=True)
class Border:
    """Normal equations of what all frames share, s coordinates in ascending order of their keys.

    Attributes:
        coupling: (6 n_free, s) with the poses.
        hessian: (s, s).
        gradient: (s,).
    """

    coupling: FloatArray
    hessian: FloatArray
    gradient: FloatArray

    @property
    def diagonal(self) -> FloatArray:
        """(s,) diagonal that damping scales with."""
        return np.maximum(np.diagonal(self.hessian), MIN_DIAGONAL)

    def eliminate(
        self, factor: Matrix, gradient: FloatArray, damping: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Solve for poses and shared coordinates together.

        Args:
            factor: Of the reduced matrix H of the poses.
            gradient: (6 n_free,) reduced gradient of the poses.
            damping: As of the poses.

        Returns:
            Steps of the poses (6 n_free,) and of what is shared (s,), ``H^-1 coupling`` (6 n_free, s), and
            the Schur complement on what is shared (s, s).
        """
        Y = factor.solve(np.column_stack([self.coupling, gradient]))
        by_shared, by_gradient = Y[:, :-1], Y[:, -1]
        complement = self.hessian + np.diag(damping * self.diagonal) - self.coupling.T @ by_shared
        right = self.gradient - self.coupling.T @ by_gradient
        shared: FloatArray = -np.linalg.solve(complement, right).astype(np.float64)
        return -by_gradient - by_shared @ shared, shared, by_shared, complement


def pose_graph_normal(
    problem: BundleProblem, values: gtsam.Values, structure: Structure
) -> tuple[sparse.csr_array, FloatArray, Border]:
    """Lower triangle of J^T J, and J^T r, of the pose factors, linearised by GTSAM; and the border."""
    n = POSE * structure.n_free
    A, b = whitened_jacobian(problem, problem.pose_graph, values, structure)
    gradient = -(A.T @ b)
    poses, shared = A[:, :n], A[:, n:].toarray()
    border = Border(poses.T @ shared, shared.T @ shared, gradient[n:])
    return sparse.tril(poses.T @ poses, format="csr"), gradient[:n], border


def whitened_jacobian(
    problem: BundleProblem, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, structure: Structure
) -> tuple[sparse.csr_array, FloatArray]:
    """Whitened Jacobian (rows, 6 n_free + shared) of factors on poses, and minus their residuals (rows,)."""
    size = POSE * structure.n_free + sum(len(vector) for vector in problem.shared.values())
    target = _columns(problem, graph, structure)
    if not len(target):
        return sparse.csr_array((0, size)), np.zeros(0)
    row, column, value = graph.linearize(values).sparseJacobian_()
    # one-based; the columns follow the keys in ascending order, the right-hand side is the last
    row, column = row.astype(np.int64) - 1, column.astype(np.int64) - 1
    right = column == len(target)
    b = np.zeros(int(row.max(initial=-1)) + 1)
    b[row[right]] = value[right]
    to = target[np.minimum(column, len(target) - 1)]
    keep = ~right & (to >= 0)
    return sparse.csr_array((value[keep], (row[keep], to[keep])), shape=(len(b), size)), b


def _columns(problem: BundleProblem, graph: gtsam.NonlinearFactorGraph, structure: Structure) -> IntArray:
    """Where each column of the factors' Jacobian goes: free poses, then what is shared; -1 if held."""
    at, start = {}, POSE * structure.n_free
    for key in sorted(problem.shared):
        at[key], start = start, start + len(problem.shared[key])
    columns, keys = [], sorted(graph.keyVector())
    own = [key for key in keys if key not in at]
    numbers = dict(zip(own, structure.free[problem.frames_of(own)].tolist(), strict=True))
    for key in keys:
        if key in at:
            columns.append(at[key] + np.arange(len(problem.shared[key])))
        else:
            number = numbers[key]
            columns.append(POSE * number + np.arange(POSE) if number >= 0 else np.full(POSE, -1))
    return np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)

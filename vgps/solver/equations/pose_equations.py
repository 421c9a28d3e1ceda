"""Normal equations of the factors on poses and states, which GTSAM linearises, and of the shared vectors."""

from dataclasses import dataclass
from typing import NamedTuple

import gtsam
import numpy as np
from scipy import sparse

from vgps.model import FloatArray, IntArray
from vgps.solver.equations.elimination import PoseFactor, SparsityStructure
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem

MIN_DIAGONAL = 1e-6  # smaller diagonals are damped as if they had this value, GTSAM's default


class BorderedSolution(NamedTuple):
    """Solution of the reduced normal equations with their border.

    Attributes:
        pose_step: (6 n_free,).
        shared_step: (s,).
        pose_by_shared: (6 n_free, s) ``H^-1 coupling``.
        complement: (s, s) Schur complement on the shared coordinates.
    """

    pose_step: FloatArray
    shared_step: FloatArray
    pose_by_shared: FloatArray
    complement: FloatArray


@dataclass(frozen=True)
class Border:
    """Normal equations of the shared vectors: s coordinates, vectors in ascending order of their keys.

    Attributes:
        coupling: (6 n_free, s) with poses and states.
        hessian: (s, s).
        gradient: (s,).
    """

    coupling: FloatArray
    hessian: FloatArray
    gradient: FloatArray

    @property
    def diagonal(self) -> FloatArray:
        """(s,) diagonal by which damping is scaled."""
        return np.maximum(np.diagonal(self.hessian), MIN_DIAGONAL)

    def eliminate(self, factor: PoseFactor, gradient: FloatArray, damping: float) -> BorderedSolution:
        """Solve for poses, states and shared vectors together.

        Args:
            factor: Cholesky factor of the reduced matrix H of poses and states.
            gradient: (6 n_free,) reduced gradient of poses and states.
            damping: Added to the border, relative to its diagonal.
        """
        Y = factor.solve(np.column_stack([self.coupling, gradient]))
        by_shared, by_gradient = Y[:, :-1], Y[:, -1]
        complement = self.hessian + np.diag(damping * self.diagonal) - self.coupling.T @ by_shared
        right = self.gradient - self.coupling.T @ by_gradient
        shared: FloatArray = -np.linalg.solve(complement, right).astype(np.float64)
        return BorderedSolution(-by_gradient - by_shared @ shared, shared, by_shared, complement)


def linearise_pose_graph(
    problem: BundleProblem, values: gtsam.Values, structure: SparsityStructure
) -> tuple[sparse.csr_array, FloatArray, Border]:
    """Return the lower triangle of J^T J and J^T r of the pose factors, and the border."""
    n = POSE_DIM * structure.n_free
    A, b = whitened_jacobian(problem, problem.pose_graph, values, structure)
    gradient = -(A.T @ b)
    poses, shared = A[:, :n], A[:, n:].toarray()
    border = Border(poses.T @ shared, shared.T @ shared, gradient[n:])
    return sparse.tril(poses.T @ poses, format="csr"), gradient[:n], border


def whitened_jacobian(
    problem: BundleProblem,
    graph: gtsam.NonlinearFactorGraph,
    values: gtsam.Values,
    structure: SparsityStructure,
) -> tuple[sparse.csr_array, FloatArray]:
    """Return the whitened Jacobian (rows, 6 n_free + s) of factors, and minus their residuals (rows,).

    Args:
        problem: Gives the keys of poses, states and shared vectors.
        graph: Factors on poses, states and shared vectors.
        values: The linearisation point.
        structure: Structure of the problem.
    """
    size = POSE_DIM * structure.n_free + sum(len(vector) for vector in problem.shared.values())
    target = _target_columns(problem, graph, structure)
    if not len(target):
        return sparse.csr_array((0, size)), np.zeros(0)
    row, column, value = graph.linearize(values).sparseJacobian_()
    # indices count from one; columns follow the keys in ascending order, the right-hand side comes last
    row, column = row.astype(np.int64) - 1, column.astype(np.int64) - 1
    right = column == len(target)
    b = np.zeros(int(row.max(initial=-1)) + 1)
    b[row[right]] = value[right]
    to = target[np.minimum(column, len(target) - 1)]
    keep = ~right & (to >= 0)
    return sparse.csr_array((value[keep], (row[keep], to[keep])), shape=(len(b), size)), b


def _target_columns(
    problem: BundleProblem, graph: gtsam.NonlinearFactorGraph, structure: SparsityStructure
) -> IntArray:
    """Return the target of each column of GTSAM's Jacobian: places, then shared vectors; -1 if held."""
    keys = sorted(graph.keyVector())
    own = [key for key in keys if key not in problem.shared]
    start = dict(zip(own, (POSE_DIM * structure.places(problem, own)).tolist(), strict=True))
    size = {key: len(state.vector) for key, state in problem.states.items()}
    at = POSE_DIM * structure.n_free
    for key in sorted(problem.shared):
        start[key], size[key] = at, len(problem.shared[key])
        at += size[key]
    columns = [
        start[key] + np.arange(size.get(key, POSE_DIM)) if start[key] >= 0 else np.full(POSE_DIM, -1)
        for key in keys
    ]
    return np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)

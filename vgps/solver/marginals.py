"""Marginal covariances of poses and shared vectors at an optimum."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vgps.errors import GeometryError
from vgps.model import FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.solver.band_matrix import POSE_DIM, NotPositiveDefiniteError
from vgps.solver.elimination import PoseMatrix, SparsityStructure, analyse_sparsity
from vgps.solver.normal_equations import Linearisation, linearise
from vgps.solver.problem import BundleProblem, all_pose_values
from vgps.solver.schur_complement import reduce_to_poses

_MIN_PIVOT = 1e-14  # relative to the diagonal: rounding error left in an undetermined direction


@dataclass(frozen=True)
class Covariances:
    """Covariances of poses and of shared vectors.

    Attributes:
        poses: (F, 6, 6) in the camera's tangent [rotation; translation], rad and m; zero for held frames.
        shared: (d, d) by key.
    """

    poses: FloatArray
    shared: Mapping[int, FloatArray]

    def scaled(self, factor: float) -> "Covariances":
        """Return all covariances times a factor."""
        return Covariances(factor * self.poses, {key: factor * block for key, block in self.shared.items()})


def marginal_covariances(problem: BundleProblem) -> Covariances:
    """Return the marginal covariances: diagonal blocks of the inverse of the reduced matrix.

    Raises:
        GeometryError: Observations and factors do not determine the poses.
    """
    structure = analyse_sparsity(problem)
    free = structure.free >= 0
    poses = np.zeros((len(free), POSE_DIM, POSE_DIM))
    with one_blas_thread():
        linear = linearise(problem, all_pose_values(problem), structure)
        factor, gradient = factorise_pose_system(linear, structure)
        poses[free] = factor.inverse_diagonal_blocks()
        if not problem.shared:
            return Covariances(poses, {})
        solution = linear.border.eliminate(factor, gradient, 0.0)
    shared: FloatArray = np.linalg.inv(solution.complement).astype(np.float64)
    rows = solution.pose_by_shared.reshape(structure.n_free, POSE_DIM, -1)
    poses[free] += rows @ shared @ rows.transpose(0, 2, 1)
    return Covariances(poses, shared_blocks(problem, shared))


def shared_blocks(problem: BundleProblem, covariance: FloatArray) -> dict[int, FloatArray]:
    """Split a covariance of all shared coordinates into the diagonal blocks of the vectors, by key."""
    blocks, at = {}, 0
    for key in sorted(problem.shared):
        span = slice(at, at + len(problem.shared[key]))
        blocks[key], at = covariance[span, span], span.stop
    return blocks


def factorise_pose_system(
    linear: Linearisation, structure: SparsityStructure
) -> tuple[PoseMatrix, FloatArray]:
    """Return the Cholesky factor of the undamped reduced matrix of the poses, and the reduced gradient.

    Raises:
        GeometryError: Observations and factors do not determine the poses.
    """
    matrix, gradient = reduce_to_poses(linear, structure, 0.0)
    try:
        return structure.cholesky(matrix, _MIN_PIVOT * linear.diagonal), gradient
    except NotPositiveDefiniteError as error:
        frame = int(np.flatnonzero(structure.free >= 0)[error.column // POSE_DIM])
        raise GeometryError(
            "its pose is not determined by observations and fixes",
            place=f"frame {frame}",
            remedy="add fixes, a prior or a motion factor that ties it to its neighbours",
        ) from None

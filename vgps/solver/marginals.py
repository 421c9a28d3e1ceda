"""Marginal covariances of poses, states and shared vectors at an optimum."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import gtsam
import numpy as np

from vgps.errors import GeometryError
from vgps.model import FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.solver.equations.elimination import PoseFactor, SparsityStructure, analyse_sparsity
from vgps.solver.equations.normal_equations import Linearisation, linearise
from vgps.solver.equations.schur_complement import reduce_to_poses
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.matrices.band_matrix import POSE_DIM, NotPositiveDefiniteError
from vgps.solver.problem import BundleProblem

_MIN_PIVOT = 1e-14  # relative to the diagonal: rounding error left in an undetermined direction


@dataclass(frozen=True)
class Covariances:
    """Covariances of poses, shared vectors and states.

    Attributes:
        poses: (F, 6, 6) in the camera's tangent [rotation; translation], rad and m; zero for held frames.
        shared: (d, d) by key.
        states: (d, d) by key.
    """

    poses: FloatArray
    shared: Mapping[int, FloatArray]
    states: Mapping[int, FloatArray] = field(default_factory=dict)

    def scaled(self, factor: float) -> "Covariances":
        """Return all covariances times a factor."""
        shared, states = (
            {key: factor * block for key, block in blocks.items()} for blocks in (self.shared, self.states)
        )
        return Covariances(factor * self.poses, shared, states)


def marginal_covariances(problem: BundleProblem) -> Covariances:
    """Return the marginal covariances: diagonal blocks of the inverse of the reduced matrix.

    Raises:
        GeometryError: Observations and factors do not determine the poses.
    """
    structure = analyse_sparsity(problem)
    shared: FloatArray = np.zeros((0, 0))
    with one_blas_thread():
        linear = linearise(problem, all_pose_values(problem), structure)
        factor, gradient = factorise_pose_system(linear, structure)
        blocks = factor.inverse_diagonal_blocks()
        if problem.shared:
            solution = linear.border.eliminate(factor, gradient, 0.0)
            shared = np.linalg.inv(solution.complement).astype(np.float64)
            rows = solution.pose_by_shared.reshape(structure.n_free, POSE_DIM, -1)
            blocks = blocks + rows @ shared @ rows.transpose(0, 2, 1)
    return split_covariances(problem, structure, blocks, shared)


def split_covariances(
    problem: BundleProblem, structure: SparsityStructure, blocks: FloatArray, shared: FloatArray
) -> Covariances:
    """Return covariances by frame and key.

    Args:
        problem: Gives the keys.
        structure: Structure of the problem.
        blocks: (n_free, 6, 6) diagonal blocks of the covariance of poses and states.
        shared: (s, s) covariance of all shared coordinates.
    """
    states = {}
    for key, place in structure.states.items():
        size = len(problem.states[key].vector)
        states[key] = blocks[place, :size, :size]
    poses = structure.to_frames(blocks.reshape(-1, POSE_DIM))
    return Covariances(poses, shared_blocks(problem, shared), states)


def shared_blocks(problem: BundleProblem, covariance: FloatArray) -> dict[int, FloatArray]:
    """Split a covariance of all shared coordinates into the diagonal blocks of the vectors, by key."""
    blocks, at = {}, 0
    for key in sorted(problem.shared):
        span = slice(at, at + len(problem.shared[key]))
        blocks[key], at = covariance[span, span], span.stop
    return blocks


def factorise_pose_system(
    linear: Linearisation, structure: SparsityStructure
) -> tuple[PoseFactor, FloatArray]:
    """Return the Cholesky factor of the undamped matrix of poses and states, and the reduced gradient.

    Raises:
        GeometryError: Observations and factors do not determine the poses.
    """
    matrix, gradient = reduce_to_poses(linear, structure, 0.0)
    try:
        return structure.cholesky(matrix, _MIN_PIVOT * linear.diagonal), gradient
    except NotPositiveDefiniteError as error:
        raise _undetermined(structure, error.column // POSE_DIM) from None


def _undetermined(structure: SparsityStructure, place: int) -> GeometryError:
    for key, state_place in structure.states.items():
        if state_place == place:
            return GeometryError(
                "it is not determined by its factors",
                place=f"state {gtsam.DefaultKeyFormatter(key)}",
                remedy="add a prior, or a factor that ties it to its neighbours",
            )
    return GeometryError(
        "its pose is not determined by observations and fixes",
        place=f"frame {int(np.flatnonzero(structure.free == place)[0])}",
        remedy="add fixes, a prior or a motion factor that ties it to its neighbours",
    )

"""Levenberg-Marquardt on a bundle problem, with the landmarks eliminated and the poses as a band or in tiles.

The result is the minimum that GTSAM's own optimiser finds, several times faster; where the poses hang
together so much that neither is sparse, GTSAM's optimiser is used.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vgps.errors import GeometryError
from vgps.model import FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.solution import SolverReport
from vgps.solver.band_matrix import POSE, NotPositiveDefiniteError
from vgps.solver.elimination import Matrix, Structure, structure_of
from vgps.solver.gtsam_backend import levenberg_of_gtsam
from vgps.solver.levenberg_marquardt import SolverSettings, levenberg
from vgps.solver.normal_equations import Linearization, linearize, reduce_to_poses
from vgps.solver.problem import BundleProblem, all_pose_values, cost_terms

__all__ = [
    "BundleResult",
    "Covariances",
    "Solver",
    "SolverSettings",
    "covariances",
    "pose_covariances",
    "solve",
]

Solver = Literal["schur", "gtsam"]

_LEAST_PIVOT = 1e-14  # relative to the diagonal: what rounding leaves of a direction that nothing determines


@dataclass(frozen=True)
class BundleResult:
    """Where the optimiser ended.

    Attributes:
        problem: The problem with its new poses and points; never of a higher cost than the one given.
        report: Cost per term before and after, iterations, and why it stopped.
        solver: Which optimiser did it.
        converged: Whether a tolerance was reached.
        stuck: Whether no step lowered the cost though the start is no minimum: the result is the start, and a
            caller must not take it for an optimum.
        seconds: Wall time.
    """

    problem: BundleProblem
    report: SolverReport
    solver: Solver
    converged: bool
    stuck: bool
    seconds: float


def solve(
    problem: BundleProblem, settings: SolverSettings | None = None, solver: Solver = "schur"
) -> BundleResult:
    """Minimise the cost over the free poses and all points.

    Args:
        problem: The start.
        settings: Tolerances and limits.
        solver: ``schur``, or ``gtsam`` for GTSAM's Levenberg-Marquardt.

    Raises:
        GeometryError: The cost at the start is not finite.
        ValueError: A landmark is seen twice in one frame, or a pose factor has a key that is no frame's.
    """
    settings = settings or SolverSettings()
    begun = time.perf_counter()
    before = cost_terms(problem)
    if not np.isfinite(sum(before.values())):
        raise GeometryError(
            f"the cost at the start is not finite ({_in_words(before)})",
            expected="poses near enough for every factor",
            remedy="start from better poses, or raise the wall's exponent in stages",
        )
    structure = structure_of(problem) if solver == "schur" else None
    if structure is not None and structure.fits(settings.max_flops, settings.max_bytes):
        with one_blas_thread():
            outcome = levenberg(problem, structure, settings)
    else:
        solver, outcome = "gtsam", levenberg_of_gtsam(problem, settings)
    report = SolverReport(before, cost_terms(outcome.problem), outcome.iterations, outcome.reason)
    seconds = time.perf_counter() - begun
    return BundleResult(outcome.problem, report, solver, outcome.converged, outcome.stuck, seconds)


def _in_words(cost: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in cost.items())


@dataclass(frozen=True)
class Covariances:
    """Covariances of poses and of what they share.

    Attributes:
        poses: (F, 6, 6) in the body tangent [rotation; translation], rad and m; held frames have zero.
        shared: (d, d) by key.
    """

    poses: FloatArray
    shared: Mapping[int, FloatArray]

    def scaled(self, factor: float) -> "Covariances":
        """All of them times a factor."""
        return Covariances(factor * self.poses, {key: factor * block for key, block in self.shared.items()})


def covariances(problem: BundleProblem) -> Covariances:
    """Marginals of the poses and of what they share: blocks of the inverse of the reduced matrix.

    Raises:
        GeometryError: Observations and factors do not determine the poses.
    """
    structure = structure_of(problem)
    moves = structure.free >= 0
    poses = np.zeros((len(moves), POSE, POSE))
    with one_blas_thread():
        linear = linearize(problem, all_pose_values(problem), structure)
        factor, gradient = factorised(linear, structure)
        poses[moves] = factor.inverse_diagonal_blocks()
        if not problem.shared:
            return Covariances(poses, {})
        _, _, by_shared, complement = linear.border.eliminate(factor, gradient, 0.0)
    of_shared: FloatArray = np.linalg.inv(complement).astype(np.float64)
    rows = by_shared.reshape(structure.n_free, POSE, -1)
    poses[moves] += rows @ of_shared @ rows.transpose(0, 2, 1)
    return Covariances(poses, shared_blocks(problem, of_shared))


def shared_blocks(problem: BundleProblem, covariance: FloatArray) -> dict[int, FloatArray]:
    """Diagonal blocks of a covariance of all shared coordinates, by key."""
    blocks, at = {}, 0
    for key in sorted(problem.shared):
        own = slice(at, at + len(problem.shared[key]))
        blocks[key], at = covariance[own, own], own.stop
    return blocks


def factorised(linear: Linearization, structure: Structure) -> tuple[Matrix, FloatArray]:
    """Cholesky factor of the reduced matrix of the poses, not damped, and their reduced gradient.

    Raises:
        GeometryError: Observations and factors do not determine the poses.
    """
    band, gradient = reduce_to_poses(linear, structure, 0.0)
    try:
        return structure.cholesky(band, _LEAST_PIVOT * linear.diagonal), gradient
    except NotPositiveDefiniteError as error:
        frame = int(np.flatnonzero(structure.free >= 0)[error.column // POSE])
        raise GeometryError(
            "its pose is not determined by observations and fixes",
            place=f"frame {frame}",
            remedy="add fixes, a prior or a motion factor that ties it to its neighbours",
        ) from None


def pose_covariances(problem: BundleProblem) -> FloatArray:
    """(F, 6, 6) of :func:`covariances`."""
    return covariances(problem).poses

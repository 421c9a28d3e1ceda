"""Whitened Jacobians of the factors on poses and vectors, by the source of their errors."""

from typing import NamedTuple

import gtsam
import numpy as np
from scipy import sparse

from vgps.model import FloatArray
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.equations.pose_equations import whitened_jacobian
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem

Graphs = tuple[gtsam.NonlinearFactorGraph, gtsam.NonlinearFactorGraph, gtsam.NonlinearFactorGraph]


class FactorJacobians(NamedTuple):
    """Whitened Jacobians (rows, 6 n_free + shared) of factors, and of all of them together.

    ``others``, ``noise`` and ``gps`` as in :class:`~vgps.smoothing.sigmas.covariance.ErrorSources`;
    ``by_position`` (M, 3, 3) are those of the residuals of ``gps`` by the fixes' positions, up to the sign.
    """

    others: sparse.csr_array
    noise: sparse.csr_array
    gps: sparse.csr_array
    by_position: FloatArray
    stacked: sparse.csr_array

    @classmethod
    def of(
        cls, problem: BundleProblem, values: gtsam.Values, graphs: Graphs, structure: SparsityStructure
    ) -> "FactorJacobians":
        """Return those of ``others``, ``noise`` and ``gps`` of a problem at these values."""
        others, noise, gps = (whitened_jacobian(problem, one, values, structure)[0] for one in graphs)
        by_position = _by_position(problem, gps, graphs[2], structure)
        return cls(others, noise, gps, by_position, sparse.csr_array(sparse.vstack([others, noise, gps])))

    def moved_with_fixes(self, moved: FloatArray) -> FloatArray:
        """Return the gradient (6 n_free + shared,) if the fixes had moved as the poses (6 n_free,) do."""
        return sum(
            (one.T @ (one[:, : len(moved)] @ moved) for one in (self.noise, self.gps)),
            start=np.zeros(self.stacked.shape[1]),
        )


def _by_position(
    problem: BundleProblem,
    by_pose: sparse.csr_array,
    gps: gtsam.NonlinearFactorGraph,
    structure: SparsityStructure,
) -> FloatArray:
    """Return the derivative (M, 3, 3) of the whitened residuals by the fixes' positions, up to the sign.

    A common translation of both frames moves the antenna relative to the fix, so that the derivative is the
    sum of the Jacobians by their translations; or it is the Jacobian by the offset.
    """
    result = np.zeros((gps.size(), 3, 3))
    for row in range(len(result)):
        keys = [key for key in list(gps.at(row).keys()) if key not in problem.shared]
        offsets = [key for key in keys if key in problem.states]
        keys = [key for key in keys if key not in problem.states]
        if not keys:  # a bound of an offset
            start = POSE_DIM * structure.states[offsets[0]]
            result[row] = by_pose[3 * row : 3 * row + 3, start : start + 3].toarray()
        for frame in problem.frames_of(keys).tolist():
            start = POSE_DIM * int(structure.free[frame]) + 3
            if structure.free[frame] >= 0:
                translation = by_pose[3 * row : 3 * row + 3, start : start + 3].toarray()
                result[row] += translation @ problem.world_T_camera[frame, :3, :3].T
    return result

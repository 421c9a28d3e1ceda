"""A Gauss-Newton step of parameters that all observations share, with poses and landmarks."""

from dataclasses import dataclass, replace

import gtsam
import numpy as np
from scipy.linalg import block_diag

from vgps.model import FloatArray
from vgps.smoothing.calibration.camera_equations import CameraEquations, ReducedEquations
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.equations.linearised_chunk import LinearisedChunk
from vgps.solver.equations.normal_equations import Linearisation
from vgps.solver.equations.schur_complement import landmark_steps, reduce_to_poses
from vgps.solver.problem import BundleProblem

_DAMPING = 1e-9  # relative: the drift of scale without fixes would otherwise be lost in rounding


@dataclass(frozen=True)
class ParameterStep:
    """Step (p,) and standard deviations (p,) of parameters; poses (F, 4, 4) and points (L, 3) that follow."""

    delta: FloatArray
    sigma: FloatArray
    poses: FloatArray
    points: FloatArray

    def part(self, share: float, poses: FloatArray, points: FloatArray) -> "ParameterStep":
        """Return a share of the step, from the poses (F, 4, 4) and points (L, 3) before it."""
        if share == 1.0:
            return self
        ends = zip(poses, self.poses, strict=True)
        between = [gtsam.Pose3(before).slerp(share, gtsam.Pose3(after)).matrix() for before, after in ends]
        moved = points + share * (self.points - points)
        return ParameterStep(share * self.delta, self.sigma, np.stack(between), moved)


@dataclass(frozen=True)
class ParameterPrior:
    """Standard deviations (p,) of a normal prior, and how far the parameters (p,) are from its mean."""

    sigma: FloatArray
    moved: FloatArray


def parameter_step(
    problem: BundleProblem,
    linear: Linearisation,
    structure: SparsityStructure,
    equations: CameraEquations,
    prior: ParameterPrior,
) -> ParameterStep:
    """Return the step to which the linearised problem and a prior lead.

    Time offset and lever arm are held; states follow the poses, and stay where they are.

    Args:
        problem: Near its optimum.
        linear: The problem, linearised.
        structure: Its structure.
        equations: Those of the parameters.
        prior: Of the parameters.

    Raises:
        NotPositiveDefiniteError: The poses are not determined.
    """
    hessian, gradient, follow = without_poses(linear, structure, equations)
    precision = 1.0 / prior.sigma**2
    information = hessian + np.diag(precision)
    gradient = gradient + precision * prior.moved
    delta: FloatArray = -np.linalg.solve(information, gradient).astype(np.float64)
    sigma: FloatArray = np.sqrt(np.diagonal(np.linalg.inv(information))).astype(np.float64)
    poses = structure.to_frames(-(follow[:, :-1] @ delta + follow[:, -1]))
    moved = tuple(_moved(part, J, delta) for part, J in zip(linear.chunks, equations.by_camera, strict=True))
    points = problem.world_p_landmark + landmark_steps(replace(linear, chunks=moved), poses, 0.0).T
    retracted = [
        gtsam.Pose3(T).retract(d).matrix() for T, d in zip(problem.world_T_camera, poses, strict=True)
    ]
    return ParameterStep(delta, sigma, np.stack(retracted), points)


def without_poses(
    linear: Linearisation, structure: SparsityStructure, equations: ReducedEquations
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Hessian (p, p) and gradient (p,) of parameters without poses and shared vectors, and how poses
    follow.

    The last is (6 n_free, p + 1): the step of poses and states is minus its first columns times that of the
    parameters, minus its last column. Time offset and lever arm follow, too: held, they would hold a focal
    length that suits them.

    Raises:
        NotPositiveDefiniteError: The poses are not determined.
    """
    V, border, p = equations.coupling, linear.border, len(equations.gradient)
    matrix, pose_gradient = reduce_to_poses(linear, structure, _DAMPING)
    right = np.column_stack([V, border.coupling, pose_gradient])
    follow = structure.cholesky(matrix).solve(right)
    left = right[:, :-1].T @ follow
    hessian = block_diag(equations.hessian, border.hessian) - left[:, :-1]
    gradient = np.concatenate([equations.gradient, border.gradient]) - left[:, -1]
    shared = np.linalg.solve(hessian[p:, p:], np.column_stack([hessian[p:, :p], gradient[p:]]))
    follow = follow[:, [*range(p), -1]] - follow[:, p:-1] @ shared
    reduced = hessian[:p, :p] - hessian[:p, p:] @ shared[:, :-1]
    return reduced, gradient[:p] - hessian[:p, p:] @ shared[:, -1], follow


def _moved(part: LinearisedChunk, J: FloatArray, delta: FloatArray) -> LinearisedChunk:
    """Return the chunk's linearisation after a step of the parameters."""
    shift = np.einsum("kin,k->in", J, delta)
    return replace(part, r=part.r + shift, gradient=part.gradient + part.landmark_gradient(shift))

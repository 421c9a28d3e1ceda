"""Poses of a rig's cameras on it, refined between the rounds of stage D.

Each is a Gauss-Newton step with a prior about the pose that ``rig.yaml`` gives. What bends the rays of a
camera, an error of its focal length above all, looks like a displacement of its centre by that share of the
depth: 0.1 % of 10 m is 1 cm. So poses that were measured well deserve to be refined all the same.
"""

from dataclasses import replace

import gtsam
import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.smoothing.calibration.camera_equations import mount_jacobian, reduced_equations
from vgps.smoothing.calibration.parameter_step import ParameterPrior, ParameterStep, parameter_step
from vgps.smoothing.context import RigMount
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.matrices.band_matrix import POSE_DIM, NotPositiveDefiniteError
from vgps.solver.problem import BundleProblem

_SIGNIFICANT_SIGMAS = 3.0  # of a change that is worth a warning


def refine_mounts(
    cameras: tuple[RigMount, ...], problem: BundleProblem, given: tuple[RigMount, ...]
) -> tuple[tuple[RigMount, ...], ParameterStep | None]:
    """Return the cameras with the poses and standard deviations to which a step from an optimum leads.

    Args:
        cameras: With the poses of the problem.
        problem: At its optimum.
        given: The cameras with their poses as given, and the standard deviations of these; 0 holds them.

    Returns:
        The cameras, and the step; None if all are held, or the problem does not determine its poses.
    """
    sigma = np.concatenate([one.sigma for one in given]) if given else np.zeros(0)
    free = np.flatnonzero(sigma > 0.0)
    if not len(free):
        return cameras, None
    moved = np.concatenate([_difference(one, old) for one, old in zip(cameras, given, strict=True)])
    try:
        step = _step(problem, free, ParameterPrior(sigma[free], moved[free]))
    except NotPositiveDefiniteError:  # of which the run warns anyway
        return cameras, None
    delta, after = np.zeros((2, len(given), POSE_DIM))
    delta.reshape(-1)[free], after.reshape(-1)[free] = step.delta, step.sigma
    refined = [_moved(one, d, s) for one, d, s in zip(cameras, delta, after, strict=True)]
    return tuple(refined), step


def _step(problem: BundleProblem, free: IntArray, prior: ParameterPrior) -> ParameterStep:
    structure = analyse_sparsity(problem)
    linear = linearise(problem, all_pose_values(problem), structure)
    by_mount = [mount_jacobian(part)[free] for part in linear.chunks]
    equations = reduced_equations(linear, structure, by_mount, len(free))
    return parameter_step(problem, linear, structure, equations, prior)


def _difference(camera: RigMount, given: RigMount) -> FloatArray:
    """Return the displacement (6,) of a camera on the rig from where it was given."""
    before, after = gtsam.Pose3(given.reference_T_camera), gtsam.Pose3(camera.reference_T_camera)
    return np.asarray(before.localCoordinates(after), np.float64)


def _moved(camera: RigMount, delta: FloatArray, sigma: FloatArray) -> RigMount:
    pose = gtsam.Pose3(camera.reference_T_camera).retract(delta).matrix()
    return replace(camera, reference_T_camera=pose, sigma=sigma)


def mount_notes(cameras: tuple[RigMount, ...], given: tuple[RigMount, ...]) -> tuple[str, ...]:
    """Return a note for each camera whose pose on the rig moved by more than three standard deviations."""
    notes = []
    for camera, before in zip(cameras, given, strict=True):
        moved = _difference(camera, before)
        if np.any(np.abs(moved) > _SIGNIFICANT_SIGMAS * np.maximum(camera.sigma, 1e-12)):
            turned_deg, off_m = np.degrees(np.linalg.norm(moved[:3])), np.linalg.norm(moved[3:])
            sigma_deg = np.degrees(camera.sigma[:3].max())
            notes.append(
                f"the pose of camera {camera.name} on the rig was refined by {turned_deg:.2f} deg (sigma "
                f"{sigma_deg:.2f}) and {100 * off_m:.1f} cm (sigma {100 * camera.sigma[3:].max():.1f})"
            )
    return tuple(notes)

"""Do the fixes contradict the lever arm that a rig gives? A wrong one shifts the path silently."""

from dataclasses import replace

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.sensors import ANTENNA
from vgps.model import FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.batch_problem import BatchInput, batch_problem
from vgps.solver.elimination import analyse_sparsity
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.marginals import factorise_pose_system
from vgps.solver.normal_equations import linearise
from vgps.solver.problem import BundleProblem

_PRIOR_M = 10.0  # says nothing
# Squared sigmas of the three coordinates together. Right lever arms reach 19 on pieces of kitti03 and kitti07
# with any receiver, since the path's errors are not independent; ones that are 1 m wrong reach 5 to 80.
_CONTRADICTION = 25.0
_DIRECTIONS = (("left", "right"), ("up", "down"), ("back", "forward"))


def lever_arm_warnings(given: BatchInput, end: BundleProblem) -> tuple[str, ...]:
    """Return a warning if the fixes fit another lever arm much better than the one that is held.

    Args:
        given: Input of the last problem of stage D.
        end: That problem at its minimum.
    """
    if given.sensors.antenna_sigma_m or not len(given.fixes):
        return ()
    try:
        step, covariance = _better_lever_arm(given, end)
    except (GeometryError, np.linalg.LinAlgError):  # said with the standard deviations of the poses
        return ()
    if step @ np.linalg.solve(covariance, step) < _CONTRADICTION:
        return ()
    ratio = np.abs(step) / np.sqrt(np.diagonal(covariance))
    shown = [
        f"{abs(step[k]):.2f} m {_DIRECTIONS[k][int(step[k] > 0)]}"
        for k in np.flatnonzero(ratio >= min(2.0, ratio.max())).tolist()
    ]
    return (
        f"the fixes fit better an antenna at least {' and '.join(shown)} of where the lever arm has it, and "
        "the path is off by as much: check camera_p_antenna in rig.yaml",
    )


def _better_lever_arm(given: BatchInput, end: BundleProblem) -> tuple[FloatArray, FloatArray]:
    """Return the step (3,) to the lever arm of the least cost, poses adapting, and its covariance (3, 3)."""
    sensors = replace(given.sensors, antenna_sigma_m=_PRIOR_M)
    scene = replace(given.scene, poses=end.world_T_camera, points=end.world_p_landmark)
    problem = batch_problem(replace(given, scene=scene, sensors=sensors)).problem
    shared = {**problem.shared, **end.shared}
    problem = problem.moved(end.world_T_camera, end.world_p_landmark, shared, end.states)
    structure = analyse_sparsity(problem)
    with one_blas_thread():
        linear = linearise(problem, all_pose_values(problem), structure)
        factor, gradient = factorise_pose_system(linear, structure)
        solution = linear.border.eliminate(factor, gradient, 0.0)
    before = sum(len(vector) for key, vector in problem.shared.items() if key < ANTENNA)
    rows = slice(before, before + 3)
    return solution.shared_step[rows], np.linalg.inv(solution.complement)[rows, rows].astype(np.float64)

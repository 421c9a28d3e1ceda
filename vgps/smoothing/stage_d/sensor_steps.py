"""What a solution of stage D says of the time offset or the lever arm that it held."""

from dataclasses import replace

import numpy as np

from vgps.gps.antenna_path import antenna_velocities
from vgps.gps.sensors import Sensors
from vgps.model import FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.stage_d.batch_problem import BatchInput, batch_problem
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.marginals import factorise_pose_system
from vgps.solver.problem import BundleProblem


def least_cost_step(
    given: BatchInput, end: BundleProblem, sensors: Sensors, key: int
) -> tuple[FloatArray, FloatArray]:
    """Return the step (d,) of a shared vector to the least cost, poses adapting, and its covariance (d, d).

    Args:
        given: Input of the problem.
        end: That problem at its minimum.
        sensors: Those of the input with priors under which the vector is free.
        key: The vector.

    Raises:
        GeometryError, LinAlgError: The problem does not determine the poses.
    """
    scene = replace(given.scene, poses=end.world_T_camera, points=end.world_p_landmark)
    # the path at its minimum has other velocities than the one that the input began with
    velocity = antenna_velocities(scene.trajectory, given.fixes.t_s, sensors.camera_p_antenna)
    given = replace(given, scene=scene, sensors=sensors, antenna_velocity=velocity)
    problem = batch_problem(given).problem
    shared = {**problem.shared, **end.shared}
    problem = problem.moved(end.world_T_camera, end.world_p_landmark, shared, end.states)
    structure = analyse_sparsity(problem)
    with one_blas_thread():
        linear = linearise(problem, all_pose_values(problem), structure)
        factor, gradient = factorise_pose_system(linear, structure)
        solution = linear.border.eliminate(factor, gradient, 0.0)
    before = sum(len(vector) for other, vector in problem.shared.items() if other < key)
    rows = slice(before, before + len(problem.shared[key]))
    return solution.shared_step[rows], np.linalg.inv(solution.complement)[rows, rows].astype(np.float64)

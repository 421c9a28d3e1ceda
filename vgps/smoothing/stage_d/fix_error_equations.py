"""Normal equations of errors of fixes in stage D, poses and landmarks eliminated: what the video allows."""

from dataclasses import replace

import numpy as np

from vgps.gps.antenna_path import antenna_velocities, place
from vgps.gps.error_steps import FixErrorEquations
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.fix_factors import gps_graph
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.model import FloatArray, IntArray
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.scene.factor_graph import build_problem, joined, other_pose_factors
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.equations.pose_equations import whitened_jacobian
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.marginals import factorise_pose_system

# what is wrong with the clock or the lever arm is no error of single fixes
_CLOCK_SIGMA_S, _ANTENNA_SIGMA_M = 0.5, 1.0


def fix_error_equations(given: BatchInput, scene: Scene, ids: IntArray, fixes: Fixes) -> FixErrorEquations:
    """Return normal equations of errors of fixes that are otherwise as good as their regions.

    Time offset and lever arm are taken as unknown.

    Args:
        given: Input of the problem; gives sigmas, lever arm and settings.
        scene: Its frames around the fixes, at the optimum.
        ids: (L,) the landmarks of the scene in the input.
        fixes: n fixes within these frames.

    Raises:
        GeometryError: The poses are not determined.
    """
    sensors, context = given.sensors, given.context
    held = Sensors.fixed(sensors.camera_p_antenna)
    gaussian = context.config.with_gps("gaussian-receiver").gps
    gps = gps_graph(_as_sure_as_regions(fixes), scene.t_s, held, gaussian)
    graph = joined(gps, other_pose_factors(scene, held, context.config))
    problem = build_problem(scene, np.nan_to_num(given.sigma_px[ids], nan=1.0), graph, context)
    structure = analyse_sparsity(problem)
    with one_blas_thread():
        values = all_pose_values(problem)
        linear = linearise(problem, values, structure)
        factor, gradient = factorise_pose_system(linear, structure)
        J, minus_residual = whitened_jacobian(problem, gps, values, structure)
        follow = factor.solve(np.column_stack([J.T.toarray(), gradient]))
    remaining = np.eye(J.shape[0]) - J @ follow[:, :-1]
    residual = -minus_residual - J @ follow[:, -1]
    weight = (1.0 / region_sigmas(fixes)).ravel()
    n = len(fixes)
    equations = FixErrorEquations(
        (weight[:, None] * remaining * weight).reshape(n, 3, n, 3), (weight * residual).reshape(n, 3)
    )
    sigma = np.array([_CLOCK_SIGMA_S, *[_ANTENNA_SIGMA_M] * 3])
    return equations.without(_by_sensors(scene, fixes, sensors.camera_p_antenna), sigma**-2.0)


def _as_sure_as_regions(fixes: Fixes) -> Fixes:
    """Return the fixes with Gaussian errors of the size of their regions."""
    return replace(fixes, sigma_m=region_sigmas(fixes), correlation=np.zeros((len(fixes), 3)))


def _by_sensors(scene: Scene, fixes: Fixes, camera_p_antenna: FloatArray) -> FloatArray:
    """Return the derivatives (n, 3, 4) of the antenna at the fixes by time offset and lever arm."""
    frame = place(scene.t_s, fixes.t_s).frame
    velocity = antenna_velocities(scene.trajectory, fixes.t_s, camera_p_antenna)
    return np.concatenate([velocity[:, :, None], scene.poses[frame, :3, :3]], axis=2)

"""Parameters that all observations share, with poses, landmarks, time offset and lever arm following."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA, K
from synthetic_map import context, map_of, scene

from vgps.config import Config
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import Camera
from vgps.smoothing.calibration.camera_equations import ReducedEquations, linearise_camera
from vgps.smoothing.calibration.parameter_step import without_poses
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.equations.pose_equations import Border
from vgps.solver.gtsam_values import all_pose_values

CAMERA = Camera(model="pinhole", width=640, height=480, fx=K[0], fy=K[1], cx=K[2], cy=K[3])


@pytest.fixture(scope="module")
def equations():
    """Stage D of fixes that are 0.2 s late, linearised by the calibration at its optimum."""
    problem, true, _, exact = scene(disturbed=0.2)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    shown = Sensors.fixed(ANTENNA).with_time_offset(TimeOffset(0.18, 0.05))
    fixes = replace(exact, t_s=exact.t_s + 0.2)
    optimum = optimise_batch(made, fixes, replace(shown, antenna_sigma_m=0.1), context(Config())).problem
    structure = analyse_sparsity(optimum)
    linear = linearise(optimum, all_pose_values(optimum), structure)
    return linear, structure, linearise_camera(optimum, linear, structure, CAMERA, 3)


def test_a_time_offset_and_a_lever_arm_follow_the_calibration(equations):
    """As where they are four more parameters, which numpy eliminates."""
    linear, structure, by_camera = equations
    border, none = linear.border, np.zeros((len(by_camera.coupling), 0))
    assert border.hessian.shape == (4, 4)
    both = ReducedEquations(
        np.column_stack([by_camera.coupling, border.coupling]),
        np.block([[by_camera.hessian, np.zeros((3, 4))], [np.zeros((4, 3)), border.hessian]]),
        np.concatenate([by_camera.gradient, border.gradient]),
    )
    alone = replace(linear, border=Border(none, np.zeros((0, 0)), np.zeros(0)))
    H, g, follow = without_poses(alone, structure, both)
    hessian, gradient, poses = without_poses(linear, structure, by_camera)
    np.testing.assert_allclose(np.linalg.inv(hessian), np.linalg.inv(H)[:3, :3], rtol=1e-6)
    step, whole = -np.linalg.solve(hessian, gradient), -np.linalg.solve(H, g)
    np.testing.assert_allclose(step, whole[:3], rtol=1e-6)
    moved, expected = poses[:, :-1] @ step + poses[:, -1], follow[:, :-1] @ whole + follow[:, -1]
    np.testing.assert_allclose(moved, expected, rtol=1e-6, atol=1e-9)


def test_a_calibration_is_less_certain_where_they_are_unknown(equations):
    linear, structure, by_camera = equations
    none = np.zeros((len(by_camera.coupling), 0))
    held = replace(linear, border=Border(none, np.zeros((0, 0)), np.zeros(0)))
    sigma, known = (
        np.sqrt(np.diagonal(np.linalg.inv(without_poses(one, structure, by_camera)[0])))
        for one in (linear, held)
    )
    assert np.all(sigma >= known) and sigma[0] > 1.001 * known[0]

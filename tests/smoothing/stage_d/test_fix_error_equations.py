"""What the video says of errors of fixes, compared with solving the problem without them."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import context, map_of, scene

from vgps.config import Config
from vgps.gps.fix_factors import gps_graph
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.smoothing.scene.factor_graph import build_problem, joined, other_pose_factors
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.scene.scene_part import SceneParts
from vgps.smoothing.stage_d import fix_error_equations as module
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.smoothing.stage_d.fix_error_equations import fix_error_equations
from vgps.solver.bundle_adjustment import solve

pytestmark = pytest.mark.slow

HELD = Sensors.fixed(ANTENNA)
GAUSSIAN = Config().with_gps("gaussian-receiver").gps


@pytest.fixture
def known_sensors(monkeypatch):
    """Clock and lever arm are right for certain."""
    monkeypatch.setattr(module, "_ANTENNA_SIGMA_M", 1e-6)
    monkeypatch.setattr(module, "_CLOCK_SIGMA_S", 1e-6)


def given_with(fixes):
    problem, true, _, _ = scene(disturbed=0.0)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    return BatchInput(
        scene=made,
        sigma_px=np.full(len(made.points), 0.5),
        control_sigma_px=np.zeros(0),
        fixes=fixes,
        sensors=HELD,
        fixed=None,
        context=context(Config()),
    )


def wrong(begin, end, shift):
    """The drive's fixes, some of them off."""
    fixes = scene()[3]
    at = fixes.world_p_fix.copy()
    at[begin:end] += shift
    return replace(fixes, world_p_fix=at)


def equations_of(fixes):
    given = given_with(fixes)
    return fix_error_equations(given, *SceneParts(given.scene).between(0, len(given.scene.t_s) - 1), fixes)


def least_cost(fixes):
    """The cost of the whole problem at its minimum, fixes as good as their regions."""
    given = given_with(fixes)
    graph = joined(
        gps_graph(module._as_sure_as_regions(fixes), given.scene.t_s, HELD, GAUSSIAN),
        other_pose_factors(given.scene, HELD, given.context.config),
    )
    problem = build_problem(given.scene, given.sigma_px, graph, given.context)
    return sum(solve(problem).report.cost_after.values())


def test_the_gain_of_a_shift_is_what_the_solver_finds_without_it(known_sensors):
    """Oracle: the difference of two minima; the shift is small, so that a linearisation says both."""
    shift = np.array([0.02, -0.03, 0.01])
    equations = equations_of(wrong(5, 9, shift))
    by_shift = equations.gradient[5:9].sum(axis=0) @ shift
    squared = shift @ equations.information[5:9, :, 5:9].sum(axis=(0, 2)) @ shift
    assert -by_shift - 0.5 * squared == pytest.approx(
        least_cost(wrong(5, 9, shift)) - least_cost(wrong(5, 9, 0.0)), rel=0.02
    )


def with_late_clock():
    fixes = scene()[3]
    return replace(fixes, t_s=fixes.t_s + 0.05)


def with_other_antenna():
    _, true, _, fixes = scene()
    frame = np.arange(len(fixes)) * 4
    return replace(fixes, world_p_fix=fixes.world_p_fix + true[frame, :3, :3] @ np.array([0.3, 0.0, 0.0]))


def gain(fixes):
    """How much the cost falls if every fix may have its error."""
    equations = equations_of(fixes)
    size = 3 * len(fixes)
    regular = equations.information.reshape(size, size) + 1e-6 * np.eye(size)
    return 0.5 * equations.gradient.ravel() @ np.linalg.solve(regular, equations.gradient.ravel())


@pytest.mark.parametrize("fixes", [with_late_clock(), with_other_antenna()], ids=["clock", "antenna"])
def test_a_clock_or_a_lever_arm_that_is_wrong_contradicts_no_fix(fixes):
    assert gain(fixes) == pytest.approx(gain(scene()[3]), abs=0.1)


def test_a_clock_that_is_right_makes_late_fixes_wrong(known_sensors):
    assert gain(with_late_clock()) > 5.0 * gain(scene()[3])


def test_wrong_fixes_are_pulled_and_right_ones_are_not():
    assert gain(wrong(5, 9, [0.3, 0.0, 0.0])) > 5.0
    assert gain(scene()[3]) < 0.5

"""Time offset and lever arm: the bordered solver against GTSAM's, and both against the truth."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from synthetic_bundle import ANTENNA as TRUE_ANTENNA
from synthetic_bundle import drive

from factors import Gaussian, gps_factor_calibrating
from vgps.config import SensorsConfig
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors, TimeOffset
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.cost import cost_terms
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.marginals import marginal_covariances

TIGHT = SolverSettings(relative_tolerance=1e-13, absolute_tolerance=1e-13)
INTERVAL_S = 0.1
TRUE_LAG_S = 0.06


def scene(time_offset_prior_s=0.5, antenna_prior_m=0.5, frames=60):
    """A winding drive with fixes whose stamps are late; time offset and lever arm unknown."""
    problem, poses = drive(frames, 400, seed=3, disturbed=0.2)
    wrong = TRUE_ANTENNA + 0.2
    sensors = Sensors(0.0, wrong, TimeOffset(0.0, time_offset_prior_s), wrong, antenna_prior_m)
    graph, penalty = sensors.priors(), Gaussian((0.02, 0.02, 0.02))
    alpha, keys = 0.3 + TRUE_LAG_S / INTERVAL_S, (TIME_OFFSET, ANTENNA)
    for i in range(1, frames - 2):
        at, to = gtsam.Pose3(poses[i]), gtsam.Pose3(poses[i + 1])
        fix = at.slerp(0.3, to).transformFrom(TRUE_ANTENNA)
        velocity = (to.transformFrom(TRUE_ANTENNA) - at.transformFrom(TRUE_ANTENNA)) / INTERVAL_S
        graph.push_back(gps_factor_calibrating((X(i), X(i + 1)), keys, alpha, fix, velocity, penalty))
    return replace(problem, pose_graph=graph, shared=sensors.shared()), sensors


@pytest.mark.slow
def test_the_bordered_solver_ends_where_gtsam_does():
    problem, _ = scene()
    ours, theirs = solve(problem, TIGHT).problem, solve(problem, TIGHT, "gtsam").problem
    assert sum(cost_terms(ours).values()) == pytest.approx(sum(cost_terms(theirs).values()), rel=1e-8)
    for key in (TIME_OFFSET, ANTENNA):
        np.testing.assert_allclose(ours.shared[key], theirs.shared[key], atol=1e-6)


@pytest.mark.slow
def test_covariances_are_gtsams():
    problem, _ = scene()
    end = solve(problem, TIGHT).problem
    graph, values = to_graph(end)
    marginals = gtsam.Marginals(graph, values)
    ours = marginal_covariances(end)
    for key in (TIME_OFFSET, ANTENNA):
        np.testing.assert_allclose(ours.shared[key], marginals.marginalCovariance(key), rtol=1e-5)
    np.testing.assert_allclose(ours.poses[20], marginals.marginalCovariance(X(20)), rtol=1e-4, atol=1e-12)


@pytest.mark.slow
def test_time_offset_and_lever_arm_are_recovered_within_their_sigmas():
    problem, sensors = scene()
    end = solve(problem, TIGHT).problem
    found, sigma = sensors.moved(end.shared), marginal_covariances(end).shared
    lag_sigma, antenna_sigma = np.sqrt(sigma[TIME_OFFSET][0, 0]), np.sqrt(np.diagonal(sigma[ANTENNA]))
    late_s, off_m = found.time_offset_s - TRUE_LAG_S, found.camera_p_antenna - TRUE_ANTENNA
    assert abs(late_s) < 3 * lag_sigma and np.all(np.abs(off_m) < 3 * antenna_sigma)
    # it never tilts: it does not show the antenna's height, which keeps its prior
    assert antenna_sigma[1] > 0.49 and antenna_sigma[0] < 0.4
    # at 6 m/s in the direction it looks, an antenna further ahead passes for fixes that are less late
    assert antenna_sigma[2] > 0.45 and lag_sigma == pytest.approx(antenna_sigma[2] / 6.0, rel=0.1)
    assert late_s == pytest.approx(off_m[2] / 6.0, abs=0.02)


@pytest.mark.slow
def test_held_sensors_are_not_changed():
    problem, sensors = scene(time_offset_prior_s=0.5, antenna_prior_m=0.0)
    found = sensors.moved(solve(problem, TIGHT).problem.shared)
    np.testing.assert_array_equal(found.camera_p_antenna, TRUE_ANTENNA + 0.2)


def test_fixed_sensors_have_no_shared_vectors():
    config = SensorsConfig(estimate_time_offset="no", time_offset_s=0.25)
    sensors = Sensors.from_config(TRUE_ANTENNA, config)
    assert not sensors.is_estimated and sensors.shared() == {} and sensors.priors().size() == 0
    assert sensors.moved({}).time_offset_s == 0.25

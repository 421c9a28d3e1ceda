from collections.abc import Callable
from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import A, B, L, X
from synthetic_bundle import ANTENNA, TIGHT, drive
from synthetic_graphs import (
    CAMERA,
    POSE_NOISE,
    Graph,
    cauchy_graph,
    graph_with_fixes,
    graph_with_held_poses,
    graph_with_known_points,
    graph_with_other_keys,
    graph_with_points_behind,
    graph_with_shuffled_keys,
    huber_graph,
    partly_robust_graph,
    plain_graph,
    small_problem,
)

from factors import Gaussian, gps_factor_calibrating
from vgps.errors import GeometryError
from vgps.solver import graph_optimiser
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.graph_optimiser import GraphResult, SolverSettings, optimise_graph, pose_marginals
from vgps.solver.gtsam_backend import optimise_with_gtsam
from vgps.solver.gtsam_graphs.graph_reading import read_graph
from vgps.solver.gtsam_graphs.gtsam_export import to_graph

CASES: dict[str, Callable[[], Graph]] = {
    "plain": plain_graph,
    "huber": huber_graph,
    "cauchy": cauchy_graph,
    "part robust": partly_robust_graph,
    "behind": graph_with_points_behind,
    "fixes": graph_with_fixes,
    "held": graph_with_held_poses,
    "known points": graph_with_known_points,
    "other keys": graph_with_other_keys,
    "shuffled keys": graph_with_shuffled_keys,
}


def optimized_by_gtsam(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.Values:
    """Run GTSAM's Levenberg-Marquardt, set up here and not by the code under test."""
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-14)
    parameters.setAbsoluteErrorTol(1e-14)
    parameters.setMaxIterations(200)
    parameters.setlambdaUpperBound(1e10)
    parameters.setDiagonalDamping(True)
    return gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()


def assert_same_poses(a: gtsam.Values, b: gtsam.Values, atol: float = 1e-6) -> None:
    poses = gtsam.utilities.extractPose3(a), gtsam.utilities.extractPose3(b)
    np.testing.assert_allclose(poses[0], poses[1], rtol=0, atol=atol)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_minimum_is_that_of_gtsam(case: str) -> None:
    graph, values = CASES[case]()
    result, reference = optimise_graph(graph, values, TIGHT), optimized_by_gtsam(graph, values)
    assert result.solver == "schur" and result.converged, result
    assert result.error_before == graph.error(values)
    assert result.error_after == graph.error(result.values) == pytest.approx(graph.error(reference), rel=1e-8)
    assert_same_poses(result.values, reference)
    assert sorted(result.values.keys()) == sorted(values.keys())
    assert result.error_after < (1.0 if case == "behind" else 0.5) * result.error_before


@pytest.mark.slow
def test_shuffled_keys_give_a_narrow_band() -> None:
    narrow = analyse_sparsity(read_graph(*graph_with_shuffled_keys(100)).problem).half_bandwidth
    by_time = analyse_sparsity(drive(frames=100, landmarks=600)[0]).half_bandwidth
    assert by_time < 200 and narrow < 1.3 * by_time


def test_held_pose_stays_to_the_last_bit() -> None:
    graph, values = graph_with_held_poses()
    found = optimise_graph(graph, values).values
    for key in (X(0), X(1)):
        np.testing.assert_array_equal(found.atPose3(key).matrix(), values.atPose3(key).matrix())


def test_variables_outside_the_graph_and_the_start_stay() -> None:
    graph, values = plain_graph()
    values.insert(99, gtsam.Pose3(gtsam.Rot3(), np.array([1.0, 2.0, 3.0])))
    values.insert(L(9999), np.array([4.0, 5.0, 6.0]))
    before = gtsam.Values(values)
    found = optimise_graph(graph, values)
    assert values.equals(before, 0.0)
    assert found.values.atPose3(99).equals(before.atPose3(99), 0.0)
    np.testing.assert_array_equal(found.values.atPoint3(L(9999)), [4.0, 5.0, 6.0])


@pytest.mark.slow
def test_time_offset_and_lever_arm_are_estimated_with_the_poses() -> None:
    problem, truth = drive(frames=24, landmarks=150)
    graph, values = to_graph(replace(problem, pose_graph=gtsam.NonlinearFactorGraph()))
    antenna = truth[:, :3, 3] + truth[:, :3, :3] @ ANTENNA
    for i in range(23):
        between, velocity = 0.5 * (antenna[i] + antenna[i + 1]), antenna[i + 1] - antenna[i]
        keys, penalty = ((X(i), X(i + 1)), (A(0), B(0))), Gaussian((0.01, 0.01, 0.01))
        graph.push_back(gps_factor_calibrating(*keys, 0.5, between, velocity, penalty))
    graph.push_back(gtsam.PriorFactorVector(A(0), np.zeros(1), gtsam.noiseModel.Isotropic.Sigma(1, 0.1)))
    graph.push_back(gtsam.PriorFactorVector(B(0), np.zeros(3), gtsam.noiseModel.Isotropic.Sigma(3, 1.0)))
    values.insert(A(0), np.zeros(1))
    values.insert(B(0), np.zeros(3))
    result = optimise_graph(graph, values, TIGHT)
    assert result.solver == "schur"
    reference = optimized_by_gtsam(graph, values)
    np.testing.assert_allclose(result.values.atVector(A(0)), reference.atVector(A(0)), atol=1e-6)
    np.testing.assert_allclose(result.values.atVector(B(0)), reference.atVector(B(0)), atol=1e-6)
    assert_same_poses(result.values, reference)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["plain", "huber", "fixes", "known points", "other keys", "shuffled keys"])
def test_marginals_equal_gtsams(case: str) -> None:
    graph, values = CASES[case]()
    best = optimise_graph(graph, values, TIGHT).values
    found, reference = pose_marginals(graph, best), gtsam.Marginals(graph, best)
    poses = gtsam.utilities.allPose3s(best)
    assert sorted(found) == sorted(poses.keys())
    for key, block in found.items():
        expected = reference.marginalCovariance(key)
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(block / np.outer(size, size), expected / np.outer(size, size), atol=1e-6)


def test_held_pose_has_no_covariance() -> None:
    found = pose_marginals(*graph_with_held_poses())
    assert not np.any(found[X(0)]) and np.all(np.diag(found[X(2)]) > 0)


def with_body(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """Add a camera with a body_P_sensor, which GTSAM does not expose to Python."""
    body_P_sensor = gtsam.Pose3(gtsam.Rot3.Ry(0.1), np.array([0.2, 0.0, 0.0]))
    key = next(key for key in list(values.keys()) if gtsam.Symbol(key).chr() == ord("l"))
    noise = gtsam.noiseModel.Isotropic.Sigma(2, 2.0)
    cameras = [values.atPose3(X(i)).compose(body_P_sensor) for i in range(24)]
    frame = next(i for i in range(24) if cameras[i].transformTo(values.atPoint3(key))[2] > 3.0)
    uv = gtsam.PinholeCameraCal3_S2(cameras[frame], CAMERA).project(values.atPoint3(key))
    graph.push_back(gtsam.GenericProjectionFactorCal3_S2(uv, noise, X(frame), key, CAMERA, body_P_sensor))


def with_calibration(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    values.insert(5, CAMERA)
    graph.addPriorCal3_S2(5, CAMERA, gtsam.noiseModel.Unit.Create(5))


OTHERS = {
    with_body: "its error is",
    with_calibration: "the variable 5 is neither pose, vector nor bias",
}


@pytest.mark.slow
@pytest.mark.parametrize("add", OTHERS, ids=lambda add: add.__name__)
def test_graph_that_is_no_bundle_problem_goes_to_gtsam_with_the_reason(add: Callable) -> None:
    graph, values = to_graph(small_problem())
    add(graph, values)
    found = optimise_graph(graph, values, TIGHT)
    assert found.solver == "gtsam" and found.fallback_reason.startswith(OTHERS[add])
    assert found.converged and found.error_after < 0.5 * found.error_before
    assert found.error_after == pytest.approx(graph.error(optimized_by_gtsam(graph, values)), rel=1e-7)


def test_graph_without_projections_goes_to_gtsam() -> None:
    problem = small_problem()
    graph, values = gtsam.NonlinearFactorGraph(problem.pose_graph), to_graph(problem)[1]
    found = optimise_graph(graph, values)
    assert found.solver == "gtsam" and found.fallback_reason.startswith("0 projections among")
    assert found.error_after < found.error_before


@pytest.mark.slow
def test_marginals_of_a_graph_that_is_no_bundle_problem_are_gtsams() -> None:
    graph, values = to_graph(small_problem())
    with_calibration(graph, values)
    best = optimise_graph(graph, values, TIGHT).values
    expected = gtsam.Marginals(graph, best).marginalCovariance(X(7))
    np.testing.assert_allclose(pose_marginals(graph, best)[X(7)], expected)


@pytest.mark.slow
def test_too_dense_graph_goes_to_gtsam_with_the_reason() -> None:
    graph, values = plain_graph()
    found = optimise_graph(graph, values, replace(TIGHT, max_flops=1e3))
    assert found.solver == "gtsam" and "coupled too densely" in found.fallback_reason
    assert found.error_after == pytest.approx(optimise_graph(graph, values, TIGHT).error_after, rel=1e-8)


def test_missing_value_and_infinite_error_are_refused() -> None:
    graph, values = plain_graph()
    graph.addPriorPose3(X(500), gtsam.Pose3(), POSE_NOISE)
    with pytest.raises(ValueError, match="no value for x500"):
        optimise_graph(graph, values)
    values.insert(X(500), gtsam.Pose3(gtsam.Rot3(), np.array([np.nan, 0.0, 0.0])))
    with pytest.raises(GeometryError, match="the error at the start is nan"):
        optimise_graph(graph, values)


@pytest.mark.slow
def test_iterations_and_reason_are_reported() -> None:
    graph, values = plain_graph()
    cut: GraphResult = optimise_graph(graph, values, SolverSettings(max_iterations=1))
    assert cut.iterations == 1 and not cut.converged and "1 iteration" in cut.reason
    again = optimise_graph(graph, optimise_graph(graph, values, TIGHT).values)
    assert again.converged and again.iterations <= 1 and "converged" in again.reason


@pytest.mark.slow
def test_gtsam_eliminates_landmarks_before_lever_arms(monkeypatch) -> None:
    graph, values = to_graph(small_problem())
    values.insert(A(0), np.zeros(1))
    values.insert(B(0), ANTENNA)
    for i in (2, 20):
        keys, penalty = ((X(i), X(i + 1)), (A(0), B(0))), Gaussian((0.1, 0.1, 0.1))
        fix, velocity = values.atPose3(X(i)).translation(), np.array([0.1, -0.2, 0.6])
        graph.push_back(gps_factor_calibrating(*keys, 0.5, fix, velocity, penalty))
    orders = []
    own = optimise_with_gtsam
    monkeypatch.setattr(graph_optimiser, "optimise_with_gtsam", lambda *a: orders.append(a[2]) or own(*a))
    optimise_graph(graph, values, replace(TIGHT, max_flops=1e3))
    (order,) = orders
    seen = [gtsam.Symbol(key).chr() == ord("l") for key in order]
    assert seen.index(False) == sum(seen) > 100 and B(0) in order


@pytest.mark.slow
def test_keys_beyond_63_bits_go_to_gtsam() -> None:
    graph, values = to_graph(small_problem())
    far = 2**63 + 5
    values.insert(far, values.atPose3(X(3)))
    graph.push_back(gtsam.BetweenFactorPose3(X(3), far, gtsam.Pose3(), POSE_NOISE))
    found = optimise_graph(graph, values, TIGHT)
    assert found.solver == "gtsam" and found.fallback_reason.startswith("keys beyond 9223372036854775807")
    assert found.error_after < 0.5 * found.error_before
    assert pose_marginals(graph, found.values)[far].shape == (6, 6)

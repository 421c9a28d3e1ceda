from collections.abc import Callable
from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.noiseModel import mEstimator
from gtsam.symbol_shorthand import A, B, L, X
from synthetic_bundle import ANTENNA, K, drive

from factors import Cylinder, Gaussian, gps_factor, gps_factor_calibrating, gps_factor_interpolated
from vgps.errors import GeometryError
from vgps.solver import graph_optimizer as engine
from vgps.solver.elimination import analyze_sparsity
from vgps.solver.graph_optimizer import GraphResult, SolverSettings, optimise_graph, pose_marginals
from vgps.solver.graph_reading import read_graph
from vgps.solver.gtsam_backend import optimise_with_gtsam
from vgps.solver.gtsam_export import to_graph
from vgps.solver.problem import BundleProblem

TIGHT = SolverSettings(relative_tolerance=1e-13, absolute_tolerance=1e-13)
POSE_NOISE = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.01, 0.01, 0.01, 0.1, 0.1, 0.1]))
CAMERA = gtsam.Cal3_S2(K[0], K[1], 0.0, K[2], K[3])
Graph = tuple[gtsam.NonlinearFactorGraph, gtsam.Values]


def small(**changes) -> BundleProblem:
    return drive(frames=24, landmarks=150, **changes)[0]


def plain() -> Graph:
    """Priors, motion, a fix at its own time and constant velocity, in C++ and in Python."""
    graph, values = to_graph(small())
    graph.addPriorPose3(X(0), values.atPose3(X(0)), POSE_NOISE)
    return graph, values


def huber() -> Graph:
    problem, _ = drive(outliers=0.05)
    return to_graph(replace(problem, robust="huber", robust_k=np.full(len(problem.frame), 1.0)))


def cauchy() -> Graph:
    problem, _ = drive(outliers=0.05, disturbed=0.3)
    return to_graph(replace(problem, robust="cauchy", robust_k=np.full(len(problem.frame), 1.5)))


def part_robust() -> Graph:
    """Half of the projections without a loss, and no outliers."""
    problem = small()
    k = np.where(problem.landmark % 2 == 0, np.inf, 1.0)
    return to_graph(replace(problem, robust="huber", robust_k=k))


def behind() -> Graph:
    problem = small()
    points = problem.world_p_landmark.copy()
    points[::30] = [0.0, 0.0, -80.0]
    return to_graph(replace(problem, world_p_landmark=points))


def with_fixes() -> Graph:
    """Fixes with a lever arm, through a cylinder and a robust Gaussian; a lever arm that is estimated."""
    problem = small()
    graph, values = to_graph(problem)
    truth = drive(frames=24, landmarks=150)[1]
    antenna = truth[:, :3, 3] + truth[:, :3, :3] @ ANTENNA
    for i in range(0, 24, 3):
        graph.push_back(gps_factor(X(i), antenna[i] + [0.05, 0, 0], ANTENNA, Cylinder(0.2, 0.3, 2, 0.5)))
    robust = Gaussian((0.1, 0.1, 0.2), cauchy_k=1.0)
    for i in range(1, 22, 5):
        between = 0.5 * (antenna[i] + antenna[i + 1])
        graph.push_back(gps_factor_interpolated((X(i), X(i + 1)), 0.5, between, ANTENNA, robust))
    return graph, values


def held() -> Graph:
    """The first pose held by a hard constraint, the second by a prior without any doubt."""
    graph, values = to_graph(small())
    graph.push_back(gtsam.NonlinearEqualityPose3(X(0), values.atPose3(X(0))))
    graph.addPriorPose3(X(1), values.atPose3(X(1)), gtsam.noiseModel.Constrained.All(6))
    return graph, values


def known_points() -> Graph:
    """Landmarks with priors, two observations in one frame, another loss and another camera for some."""
    graph, values = to_graph(small())
    points = [key for key in list(values.keys()) if gtsam.Symbol(key).chr() == ord("l")]
    tight = gtsam.noiseModel.Isotropic.Sigma(3, 0.02)
    for key in points[:3]:
        graph.addPriorPoint3(key, values.atPoint3(key) + 0.05, tight)
    noise = gtsam.noiseModel.Isotropic.Sigma(2, 2.0)
    first = next(
        f for f in map(graph.at, range(graph.size())) if isinstance(f, gtsam.GenericProjectionFactorCal3_S2)
    )
    graph.push_back(
        gtsam.GenericProjectionFactorCal3_S2(first.measured() + 1.0, noise, *first.keys(), CAMERA)
    )
    wild = gtsam.noiseModel.Robust.Create(mEstimator.Tukey.Create(8.0), noise)
    pose = values.atPose3(X(5))
    seen = [k for k in points[10:] if (pose.transformTo(values.atPoint3(k)))[2] > 3.0][:2]
    other = gtsam.Cal3_S2(450.0, 450.0, 1.0, 300.0, 250.0)
    for key, model, camera in ((seen[0], wild, CAMERA), (seen[1], noise, other)):
        uv = gtsam.PinholeCameraCal3_S2(pose, camera).project(values.atPoint3(key)) + 1.0
        graph.push_back(gtsam.GenericProjectionFactorCal3_S2(uv, model, X(5), key, camera))
    return graph, values


def other_keys() -> Graph:
    """Keys of poses that neither begin with x nor follow each other, and points whose keys come before."""
    graph, values = to_graph(small())
    names = {X(i): gtsam.symbol("q", 7 * i + 3) for i in range(24)}
    names |= {
        key: gtsam.symbol("a", 2 * gtsam.Symbol(key).index())
        for key in list(values.keys())
        if key not in names
    }
    renamed, there = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for i in range(graph.size()):
        factor = graph.at(i)
        if not isinstance(factor, gtsam.CustomFactor):  # they cannot be renamed
            renamed.push_back(factor.rekey([names[key] for key in list(factor.keys())]))
    poses = gtsam.utilities.allPose3s(values)
    for key in list(values.keys()):
        there.insert(names[key], values.atPose3(key) if poses.exists(key) else values.atPoint3(key))
    fix = gps_factor(names[X(4)], values.atPose3(X(4)).translation(), np.zeros(3), Cylinder(0.1, 0.1, 1, 0.5))
    renamed.push_back(fix)
    renamed.addPriorPose3(names[X(0)], there.atPose3(names[X(0)]), POSE_NOISE)
    return renamed, there


def shuffled_keys(frames: int = 24) -> Graph:
    """Pictures of no order: neighbours in time have keys far apart."""
    problem, _ = drive(frames=frames, landmarks=6 * frames)
    place = np.random.default_rng(1).permutation(frames)
    graph, values = to_graph(replace(problem, pose_graph=gtsam.NonlinearFactorGraph()))
    renamed, there = gtsam.NonlinearFactorGraph(), gtsam.Values(values)
    names = {X(i): X(int(place[i])) for i in range(frames)}
    for factor in map(graph.at, range(graph.size())):
        renamed.push_back(factor.rekey([names.get(key, key) for key in list(factor.keys())]))
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    loose = gtsam.noiseModel.Isotropic.Sigma(6, 1.0)
    for i in range(frames):
        pose = values.atPose3(X(i))
        there.update(names[X(i)], pose)
        renamed.push_back(gtsam.GPSFactor(names[X(i)], pose.translation(), noise))
        renamed.push_back(gtsam.PriorFactorPose3(names[X(i)], pose, loose))
    return renamed, there


CASES: dict[str, Callable[[], Graph]] = {
    "plain": plain,
    "huber": huber,
    "cauchy": cauchy,
    "part robust": part_robust,
    "behind": behind,
    "fixes": with_fixes,
    "held": held,
    "known points": known_points,
    "other keys": other_keys,
    "shuffled keys": shuffled_keys,
}


def gtsams_own(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.Values:
    """GTSAM's Levenberg-Marquardt, set up here and not by the code under test."""
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


@pytest.mark.parametrize("case", CASES)
def test_ends_where_gtsams_own_optimiser_ends(case: str) -> None:
    graph, values = CASES[case]()
    ours, theirs = optimise_graph(graph, values, TIGHT), gtsams_own(graph, values)
    assert ours.solver == "schur" and ours.converged, ours
    assert ours.error_before == graph.error(values)
    assert ours.error_after == graph.error(ours.values) == pytest.approx(graph.error(theirs), rel=1e-8)
    assert_same_poses(ours.values, theirs)
    assert sorted(ours.values.keys()) == sorted(values.keys())
    assert ours.error_after < (1.0 if case == "behind" else 0.5) * ours.error_before


def test_keys_of_no_order_give_a_narrow_band() -> None:
    narrow = analyze_sparsity(read_graph(*shuffled_keys(100)).problem).half_bandwidth
    by_time = analyze_sparsity(drive(frames=100, landmarks=600)[0]).half_bandwidth
    assert by_time < 200 and narrow < 1.3 * by_time


def test_a_held_pose_stays_to_the_last_bit() -> None:
    graph, values = held()
    found = optimise_graph(graph, values).values
    for key in (X(0), X(1)):
        np.testing.assert_array_equal(found.atPose3(key).matrix(), values.atPose3(key).matrix())


def test_what_the_graph_does_not_have_stays_and_the_start_is_not_touched() -> None:
    graph, values = plain()
    values.insert(99, gtsam.Pose3(gtsam.Rot3(), np.array([1.0, 2.0, 3.0])))
    values.insert(L(9999), np.array([4.0, 5.0, 6.0]))
    before = gtsam.Values(values)
    found = optimise_graph(graph, values)
    assert values.equals(before, 0.0)
    assert found.values.atPose3(99).equals(before.atPose3(99), 0.0)
    np.testing.assert_array_equal(found.values.atPoint3(L(9999)), [4.0, 5.0, 6.0])


def test_a_lag_and_a_lever_arm_are_estimated_with_the_poses() -> None:
    problem, truth = drive(frames=24, landmarks=150)
    graph, values = to_graph(replace(problem, pose_graph=gtsam.NonlinearFactorGraph()))
    antenna = truth[:, :3, 3] + truth[:, :3, :3] @ ANTENNA
    for i in range(23):
        at = (float(i), i + 1.0, i + 0.5)
        between = 0.5 * (antenna[i] + antenna[i + 1])
        graph.push_back(
            gps_factor_calibrating((X(i), X(i + 1)), (A(0), B(0)), at, between, Gaussian((0.01, 0.01, 0.01)))
        )
    graph.push_back(gtsam.PriorFactorVector(A(0), np.zeros(1), gtsam.noiseModel.Isotropic.Sigma(1, 0.1)))
    graph.push_back(gtsam.PriorFactorVector(B(0), np.zeros(3), gtsam.noiseModel.Isotropic.Sigma(3, 1.0)))
    values.insert(A(0), np.zeros(1))
    values.insert(B(0), np.zeros(3))
    ours = optimise_graph(graph, values, TIGHT)
    assert ours.solver == "schur"
    theirs = gtsams_own(graph, values)
    np.testing.assert_allclose(ours.values.atVector(A(0)), theirs.atVector(A(0)), atol=1e-6)
    np.testing.assert_allclose(ours.values.atVector(B(0)), theirs.atVector(B(0)), atol=1e-6)
    assert_same_poses(ours.values, theirs)


@pytest.mark.parametrize("case", ["plain", "huber", "fixes", "known points", "other keys", "shuffled keys"])
def test_marginals_are_gtsams(case: str) -> None:
    graph, values = CASES[case]()
    best = optimise_graph(graph, values, TIGHT).values
    found, theirs = pose_marginals(graph, best), gtsam.Marginals(graph, best)
    poses = gtsam.utilities.allPose3s(best)
    assert sorted(found) == sorted(poses.keys())
    for key, block in found.items():
        expected = theirs.marginalCovariance(key)
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(block / np.outer(size, size), expected / np.outer(size, size), atol=1e-6)


def test_a_held_pose_has_no_covariance() -> None:
    found = pose_marginals(*held())
    assert not np.any(found[X(0)]) and np.all(np.diag(found[X(2)]) > 0)


def with_body(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """A camera that does not sit in the middle of its body: GTSAM does not say so to Python."""
    body_P_sensor = gtsam.Pose3(gtsam.Rot3.Ry(0.1), np.array([0.2, 0.0, 0.0]))
    key = next(key for key in list(values.keys()) if gtsam.Symbol(key).chr() == ord("l"))
    noise = gtsam.noiseModel.Isotropic.Sigma(2, 2.0)
    cameras = [values.atPose3(X(i)).compose(body_P_sensor) for i in range(24)]
    frame = next(i for i in range(24) if cameras[i].transformTo(values.atPoint3(key))[2] > 3.0)
    uv = gtsam.PinholeCameraCal3_S2(cameras[frame], CAMERA).project(values.atPoint3(key))
    graph.push_back(gtsam.GenericProjectionFactorCal3_S2(uv, noise, X(frame), key, CAMERA, body_P_sensor))


def with_velocities(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    for i in range(400):
        values.insert(i, np.ones(3))
        graph.addPriorPoint3(i, np.zeros(3), gtsam.noiseModel.Unit.Create(3))


def with_calibration(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    values.insert(5, CAMERA)
    graph.addPriorCal3_S2(5, CAMERA, gtsam.noiseModel.Unit.Create(5))


def with_constraint(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    motion = values.atPose3(X(3)).between(values.atPose3(X(4)))
    graph.push_back(gtsam.BetweenFactorPose3(X(3), X(4), motion, gtsam.noiseModel.Constrained.All(6)))


OTHERS = {
    with_body: "its error is",
    with_velocities: "1200 coordinates besides poses and landmarks",
    with_calibration: "the variable 5 is neither a pose nor a vector",
    with_constraint: "a hard constraint",
}


@pytest.mark.parametrize("add", OTHERS, ids=lambda add: add.__name__)
def test_what_the_engine_does_not_do_goes_to_gtsam_and_is_said(add: Callable) -> None:
    graph, values = to_graph(small())
    add(graph, values)
    found = optimise_graph(graph, values, TIGHT)
    assert found.solver == "gtsam" and found.why_gtsam.startswith(OTHERS[add])
    assert found.converged and found.error_after < 0.5 * found.error_before
    assert found.error_after == pytest.approx(graph.error(gtsams_own(graph, values)), rel=1e-7)


def test_a_graph_of_poses_alone_goes_to_gtsam() -> None:
    problem = small()
    graph, values = gtsam.NonlinearFactorGraph(problem.pose_graph), to_graph(problem)[1]
    found = optimise_graph(graph, values)
    assert found.solver == "gtsam" and found.why_gtsam.startswith("0 projections among")
    assert found.error_after < found.error_before


def test_marginals_of_what_the_engine_does_not_do_are_gtsams() -> None:
    graph, values = to_graph(small())
    with_calibration(graph, values)
    best = optimise_graph(graph, values, TIGHT).values
    expected = gtsam.Marginals(graph, best).marginalCovariance(X(7))
    np.testing.assert_allclose(pose_marginals(graph, best)[X(7)], expected)


def test_too_dense_a_graph_goes_to_gtsam_and_is_said() -> None:
    graph, values = plain()
    found = optimise_graph(graph, values, replace(TIGHT, max_flops=1e3))
    assert found.solver == "gtsam" and "coupled too densely" in found.why_gtsam
    assert found.error_after == pytest.approx(optimise_graph(graph, values, TIGHT).error_after, rel=1e-8)


def test_a_missing_value_and_an_infinite_error_are_refused() -> None:
    graph, values = plain()
    graph.addPriorPose3(X(500), gtsam.Pose3(), POSE_NOISE)
    with pytest.raises(ValueError, match="no value for x500"):
        optimise_graph(graph, values)
    values.insert(X(500), gtsam.Pose3(gtsam.Rot3(), np.array([np.nan, 0.0, 0.0])))
    with pytest.raises(GeometryError, match="the error at the start is nan"):
        optimise_graph(graph, values)


def test_it_says_when_and_why_it_stopped() -> None:
    graph, values = plain()
    cut: GraphResult = optimise_graph(graph, values, SolverSettings(max_iterations=1))
    assert cut.iterations == 1 and not cut.converged and "1 iteration" in cut.reason
    again = optimise_graph(graph, optimise_graph(graph, values, TIGHT).values)
    assert again.converged and again.iterations <= 1 and "converged" in again.reason


def test_gtsams_optimiser_eliminates_what_is_seen_first_and_lever_arms_last(monkeypatch) -> None:
    graph, values = to_graph(small())
    values.insert(A(0), np.zeros(1))
    values.insert(B(0), ANTENNA)
    for i in (2, 20):
        at = (float(i), i + 1.0, i + 0.5)
        fix, penalty = values.atPose3(X(i)).translation(), Gaussian((0.1, 0.1, 0.1))
        graph.push_back(gps_factor_calibrating((X(i), X(i + 1)), (A(0), B(0)), at, fix, penalty))
    orders = []
    own = optimise_with_gtsam
    monkeypatch.setattr(engine, "optimise_with_gtsam", lambda *a: orders.append(a[2]) or own(*a))
    optimise_graph(graph, values, replace(TIGHT, max_flops=1e3))
    (order,) = orders
    seen = [gtsam.Symbol(key).chr() == ord("l") for key in order]
    assert seen.index(False) == sum(seen) > 100 and B(0) in order


def test_keys_beyond_63_bits_go_to_gtsam() -> None:
    graph, values = to_graph(small())
    far = 2**63 + 5
    values.insert(far, values.atPose3(X(3)))
    graph.push_back(gtsam.BetweenFactorPose3(X(3), far, gtsam.Pose3(), POSE_NOISE))
    found = optimise_graph(graph, values, TIGHT)
    assert found.solver == "gtsam" and found.why_gtsam.startswith("keys beyond 9223372036854775807")
    assert found.error_after < 0.5 * found.error_before
    assert pose_marginals(graph, found.values)[far].shape == (6, 6)

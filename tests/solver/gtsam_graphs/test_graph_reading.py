from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import B, L, X
from synthetic_bundle import drive, total_cost, with_loss

from vgps.solver.gtsam_graphs.graph_reading import NotABundleError, is_pose, read_graph
from vgps.solver.gtsam_graphs.gtsam_export import to_graph

Graph = tuple[gtsam.NonlinearFactorGraph, gtsam.Values]


@pytest.fixture
def graph() -> Graph:
    return to_graph(with_loss(drive(frames=12, landmarks=80)[0], "huber"))


def test_bundle_problem_is_read_back(graph: Graph) -> None:
    problem = with_loss(drive(frames=12, landmarks=80)[0], "huber")
    bundle = read_graph(*graph)
    read = bundle.problem
    assert read.K == problem.K and read.robust == "huber"
    np.testing.assert_array_equal(read.keys, problem.keys)
    order, expected = (
        np.lexsort((p.frame, keys))
        for p, keys in ((read, bundle.landmark_keys[read.landmark]), (problem, problem.landmark))
    )
    np.testing.assert_array_equal(read.uv_px[order], problem.uv_px[expected])
    np.testing.assert_array_equal(read.sigma_px[order], problem.sigma_px[expected])
    np.testing.assert_allclose(read.robust_k, 1.0)
    assert read.pose_graph.size() == problem.pose_graph.size()
    assert total_cost(read) == pytest.approx(graph[0].error(graph[1]), rel=1e-12)


def test_values_follow_the_problem(graph: Graph) -> None:
    bundle = read_graph(*graph)
    problem = bundle.problem
    poses = problem.world_T_camera.copy()
    poses[:, :3, 3] += 1.0
    values = bundle.values_of(problem.moved(poses, problem.world_p_landmark - 2.0))
    np.testing.assert_allclose(values.atPose3(X(3)).matrix(), poses[3])
    row = 7
    key = int(bundle.landmark_keys[row])
    np.testing.assert_allclose(values.atPoint3(key), problem.world_p_landmark[row] - 2.0)
    np.testing.assert_array_equal(graph[1].atPoint3(key), problem.world_p_landmark[row])


def test_variable_that_is_neither_pose_nor_landmark_is_shared(graph: Graph) -> None:
    factors, values = graph
    values.insert(B(0), np.array([1.0, 2.0, 3.0]))
    factors.push_back(gtsam.PriorFactorVector(B(0), np.zeros(3), gtsam.noiseModel.Unit.Create(3)))
    bundle = read_graph(factors, values)
    assert list(bundle.problem.shared) == [B(0)]
    moved = bundle.problem.moved(
        bundle.problem.world_T_camera, bundle.problem.world_p_landmark, {B(0): np.array([4.0, 5.0, 6.0])}
    )
    np.testing.assert_allclose(bundle.values_of(moved).atVector(B(0)), [4.0, 5.0, 6.0])


def test_landmark_with_a_prior_is_shared_and_keeps_its_projections(graph: Graph) -> None:
    factors, values = graph
    problem = read_graph(factors, values).problem
    key = L(int(drive(frames=12, landmarks=80)[0].landmark[0]))
    observations = int(np.sum(drive(frames=12, landmarks=80)[0].landmark == gtsam.Symbol(key).index()))
    factors.addPriorPoint3(key, values.atPoint3(key), gtsam.noiseModel.Unit.Create(3))
    read = read_graph(factors, values).problem
    assert list(read.shared) == [key]
    assert len(read.frame) == len(problem.frame) - observations
    assert read.pose_graph.size() == problem.pose_graph.size() + observations + 1


def test_held_poses_are_fixed(graph: Graph) -> None:
    factors, values = graph
    factors.push_back(gtsam.NonlinearEqualityPose3(X(2), values.atPose3(X(2))))
    factors.addPriorPose3(X(5), values.atPose3(X(5)), gtsam.noiseModel.Constrained.All(6))
    np.testing.assert_array_equal(np.flatnonzero(read_graph(factors, values).problem.fixed_frames), [2, 5])


def test_order_of_the_poses_is_changed_only_where_it_narrows_the_band() -> None:
    """Keys in order of time stay; with shuffled ones, frames that follow each other end up close together."""
    problem, _ = drive(frames=40, landmarks=250)
    problem = replace(problem, pose_graph=gtsam.NonlinearFactorGraph())
    graph, values = to_graph(problem)
    np.testing.assert_array_equal(read_graph(graph, values).problem.keys, problem.keys)
    place = np.random.default_rng(0).permutation(40)
    shuffled, moved = gtsam.NonlinearFactorGraph(), gtsam.Values(values)
    for factor in map(graph.at, range(graph.size())):
        pose, point = factor.keys()
        shuffled.push_back(factor.rekey([X(int(place[pose - X(0)])), point]))
    for i in range(40):
        moved.update(X(int(place[i])), values.atPose3(X(i)))
    read = read_graph(shuffled, moved).problem
    rank = np.array([int(np.flatnonzero(read.keys == X(int(place[i])))[0]) for i in range(40)])
    neighbours = np.abs(np.diff(rank))
    assert np.median(neighbours) <= 2 and neighbours.max() < 10


def test_poses_are_distinguished_from_vectors() -> None:
    values = gtsam.Values()
    values.insert(X(0), gtsam.Pose3())
    values.insert(B(0), np.zeros(3))
    assert is_pose(values, X(0)) and not is_pose(values, B(0))


def add_rotation(factors: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    values.insert(B(0), gtsam.Rot3())
    factors.addPriorRot3(B(0), gtsam.Rot3(), gtsam.noiseModel.Unit.Create(3))


def add_many_vectors(factors: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    for i in range(101):
        values.insert(B(i), np.zeros(3))
        factors.addPriorPoint3(B(i), np.zeros(3), gtsam.noiseModel.Unit.Create(3))


def add_key_beyond_63_bits(factors: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    values.insert(2**63 + 5, gtsam.Pose3())
    factors.addPriorPose3(2**63 + 5, gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6))


def add_constraint(factors: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    elsewhere = values.atPose3(X(1)).compose(gtsam.Pose3(gtsam.Rot3(), np.ones(3)))
    factors.addPriorPose3(X(1), elsewhere, gtsam.noiseModel.Constrained.All(6))


def add_mounted_camera(factors: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """A camera with a body_P_sensor, which GTSAM does not expose to Python."""
    body_P_sensor = gtsam.Pose3(gtsam.Rot3.Ry(0.1), np.array([0.2, 0.0, 0.0]))
    first = next(
        f
        for f in map(factors.at, range(factors.size()))
        if isinstance(f, gtsam.GenericProjectionFactorCal3_S2)
    )
    pose = values.atPose3(first.keys()[0])
    values.insert(L(9999), pose.transformFrom(np.array([0.5, 0.3, 6.0])))
    factors.push_back(
        gtsam.GenericProjectionFactorCal3_S2(
            first.measured(), first.noiseModel(), first.keys()[0], L(9999), first.calibration(), body_P_sensor
        )
    )


@pytest.mark.parametrize(
    ("add", "reason"),
    [
        (add_rotation, "the variable b0 is neither pose, vector nor bias"),
        (
            add_many_vectors,
            "303 coordinates of points and vectors that all poses share, at most 300",
        ),
        (add_key_beyond_63_bits, "keys beyond 9223372036854775807"),
        (add_constraint, "a hard constraint other than one that holds a pose at its value"),
        (add_mounted_camera, "its error is"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_graph_that_is_no_bundle_problem_is_refused_with_the_reason(graph: Graph, add, reason: str) -> None:
    add(*graph)
    with pytest.raises(NotABundleError) as refusal:
        read_graph(*graph)
    assert str(refusal.value).startswith(reason)


def test_graph_with_few_projections_is_refused(graph: Graph) -> None:
    problem, _ = drive(frames=12, landmarks=80)
    with pytest.raises(NotABundleError, match=f"0 projections among {problem.pose_graph.size()} factors"):
        read_graph(problem.pose_graph, graph[1])

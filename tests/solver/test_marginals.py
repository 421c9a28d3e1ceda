from collections.abc import Callable
from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import O, X
from synthetic_bundle import TIGHT, drive, held_frames, interrupted_tracks, sparse_tracks, with_loss
from synthetic_states import drive_with_states

from vgps.errors import GeometryError
from vgps.solver.bundle_adjustment import solve
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.marginals import Covariances, marginal_covariances, shared_blocks
from vgps.solver.problem import BundleProblem
from vgps.solver.state_vectors import StateVector

CASES: dict[str, Callable[[], BundleProblem]] = {
    "plain": lambda: drive()[0],
    "huber": lambda: with_loss(drive(outliers=0.05)[0], "huber"),
    "gap": interrupted_tracks,
    "sparse": sparse_tracks,
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_covariances_equal_gtsams_marginals(case: str) -> None:
    problem = solve(CASES[case](), TIGHT).problem
    marginals = gtsam.Marginals(*to_graph(problem))
    expected = np.stack([marginals.marginalCovariance(X(i)) for i in range(40)])
    found = marginal_covariances(problem).poses
    size = np.sqrt(np.einsum("fii->fi", expected))
    np.testing.assert_allclose((found - expected) / size[:, :, None] / size[:, None, :], 0.0, atol=1e-6)


def test_held_frames_have_no_covariance() -> None:
    problem = held_frames()
    covariance = marginal_covariances(problem).poses
    assert not np.any(covariance[problem.fixed])
    graph, values = to_graph(replace(problem, fixed=None))
    tight = gtsam.noiseModel.Isotropic.Sigma(6, 1e-6)
    for i in np.flatnonzero(problem.fixed).tolist():
        graph.addPriorPose3(X(i), values.atPose3(X(i)), tight)
    expected = gtsam.Marginals(graph, values).marginalCovariance(X(20))
    np.testing.assert_allclose(covariance[20], expected, rtol=1e-4, atol=1e-4 * np.max(expected))


def test_undetermined_poses_are_refused() -> None:
    problem, _ = drive(frames=10, landmarks=80)
    with pytest.raises(GeometryError, match=r"frame \d+: its pose is not determined"):
        marginal_covariances(replace(problem, pose_graph=gtsam.NonlinearFactorGraph()))


def test_blocks_of_shared_vectors_follow_the_order_of_their_keys() -> None:
    problem, _ = drive(frames=4, landmarks=20)
    problem = replace(problem, shared={9: np.zeros(1), 2: np.zeros(2)})
    blocks = shared_blocks(problem, np.arange(9.0).reshape(3, 3))
    np.testing.assert_array_equal(blocks[2], [[0.0, 1.0], [3.0, 4.0]])
    np.testing.assert_array_equal(blocks[9], [[8.0]])


def test_scaling_applies_to_poses_and_vectors() -> None:
    scaled = Covariances(np.ones((2, 6, 6)), {1: np.eye(2)}, {2: np.ones((1, 1))}).scaled(4.0)
    assert np.all(scaled.poses == 4.0)
    np.testing.assert_array_equal(scaled.shared[1], 4.0 * np.eye(2))
    np.testing.assert_array_equal(scaled.states[2], [[4.0]])


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_covariances_of_states_equal_gtsams_marginals(held: bool) -> None:
    problem = solve(drive_with_states(held), TIGHT).problem
    marginals = gtsam.Marginals(*to_graph(problem))
    found = marginal_covariances(problem)
    assert found.states.keys() == problem.states.keys()
    moved = np.flatnonzero(~problem.fixed_frames).tolist()
    blocks = {**found.states, **found.shared, **{X(i): found.poses[i] for i in moved}}
    for key, block in blocks.items():
        expected = marginals.marginalCovariance(key)
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(block / np.outer(size, size), expected / np.outer(size, size), atol=1e-6)


def test_undetermined_state_is_refused_by_its_name() -> None:
    problem = drive_with_states()
    problem = replace(problem, states={**problem.states, O(8): StateVector(np.zeros(3), 39)})
    with pytest.raises(GeometryError, match="state o8: it is not determined"):
        marginal_covariances(problem)

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import A, B, L, O, X
from synthetic_bundle import TIGHT, drive
from synthetic_states import offset_fix, walk

from vgps.solver.graph_optimiser import optimise_graph
from vgps.solver.gtsam_backend import optimise_with_gtsam
from vgps.solver.gtsam_graphs import graph_reading
from vgps.solver.gtsam_graphs.graph_reading import read_graph
from vgps.solver.gtsam_graphs.graph_vectors import split_vectors
from vgps.solver.gtsam_graphs.gtsam_export import to_graph

FRAMES = {X(i): i for i in range(100)}
UNIT = gtsam.noiseModel.Unit.Create


def tie(*keys: int) -> gtsam.CustomFactor:
    """A factor that is never evaluated."""
    return gtsam.CustomFactor(UNIT(3), list(keys), lambda *_: np.zeros(3))


@pytest.fixture
def graph() -> gtsam.NonlinearFactorGraph:
    """Offsets o0, o1, o2 of frames 10-18, none, and 30-38, which walk from one to the next."""
    graph = gtsam.NonlinearFactorGraph()
    for start, key in ((10, O(0)), (30, O(2))):
        for frame in range(start + 8, start - 1, -2):
            graph.push_back(tie(X(frame), X(frame + 1), key))
    graph.push_back(tie(O(0), O(1)))
    graph.push_back(tie(O(1), O(2)))
    return graph


def test_offsets_are_states_at_their_first_frames(graph: gtsam.NonlinearFactorGraph) -> None:
    vectors = {O(k): np.full(3, float(k)) for k in range(3)}
    shared, states = split_vectors(graph, vectors, FRAMES, 30)
    assert shared == {}
    # the one without fixes stands at the first of its neighbours
    assert {key: state.frame for key, state in states.items()} == {O(0): 10, O(1): 10, O(2): 30}
    np.testing.assert_array_equal(states[O(2)].vector, [2.0, 2.0, 2.0])


def test_vectors_of_distant_frames_are_shared(graph: gtsam.NonlinearFactorGraph) -> None:
    graph.push_back(tie(X(5), A(0)))
    graph.push_back(tie(X(90), A(0)))
    for k in (0, 2):
        graph.push_back(tie(O(k), A(1)))  # the mean of all offsets
    graph.push_back(gtsam.PriorFactorVector(B(0), np.zeros(3), UNIT(3)))  # of no frame
    vectors = {key: np.zeros(3) for key in (O(0), O(1), O(2), A(0), A(1), B(0))}
    shared, states = split_vectors(graph, vectors, FRAMES, 12)
    assert sorted(shared) == sorted([A(0), A(1), B(0), O(1)])
    assert sorted(states) == [O(0), O(2)]


def test_observed_points_and_long_vectors_are_shared() -> None:
    graph = gtsam.NonlinearFactorGraph()
    K = gtsam.Cal3_S2(500.0, 500.0, 0.0, 320.0, 240.0)
    graph.push_back(gtsam.GenericProjectionFactorCal3_S2(np.zeros(2), UNIT(2), X(3), L(0), K))
    graph.push_back(tie(X(3), B(0)))
    shared, states = split_vectors(graph, {L(0): np.zeros(3), B(0): np.zeros(7)}, FRAMES, 20)
    assert sorted(shared) == [B(0), L(0)] and not states


@pytest.mark.slow
def test_graph_with_more_offsets_than_a_border_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    """An offset for every frame."""
    monkeypatch.setattr(graph_reading, "_MAX_SHARED_SIZE", 89)
    problem, poses = drive(frames=30, landmarks=200)
    graph, values = to_graph(problem)
    for i in range(30):
        fix = poses[i, :3, 3] + [0.3 * np.sin(0.1 * i), 0.1, 0.0]
        graph.push_back(offset_fix(i, fix, every=1))
        values.insert(O(i), np.zeros(3))
    graph.push_back(walk(30, robust=True))
    states = read_graph(graph, values).problem.states
    assert [state.frame for state in states.values()] == list(range(30))
    result = optimise_graph(graph, values, TIGHT)
    assert result.solver == "schur" and result.converged
    colamd = gtsam.Ordering.ColamdNonlinearFactorGraph(graph)
    order = [colamd.at(i) for i in range(colamd.size())]
    reference, _ = optimise_with_gtsam(graph, values, order, TIGHT)
    assert result.error_after == pytest.approx(graph.error(reference), rel=1e-8)
    for i in (0, 15, 29):
        np.testing.assert_allclose(result.values.atVector(O(i)), reference.atVector(O(i)), atol=1e-5)

from dataclasses import replace

import numpy as np
import pytest
from gtsam.symbol_shorthand import O, X
from synthetic_bundle import drive

from vgps.solver.equations.unknowns import number_unknowns
from vgps.solver.problem import BundleProblem
from vgps.solver.state_vectors import StateVector


@pytest.fixture
def problem() -> BundleProblem:
    """Frames x0, x1, (x2), (x3), x4 of which those in brackets are held, and states o0 to o3."""
    places = {O(2): (4, 3), O(0): (0, 3), O(3): (3, 6), O(1): (0, 1)}
    states = {key: StateVector(np.zeros(size), frame) for key, (frame, size) in places.items()}
    bare, _ = drive(frames=5, landmarks=20)
    return replace(bare, states=states, fixed=np.isin(np.arange(5), [2, 3]))


def test_states_stand_after_their_frames(problem: BundleProblem) -> None:
    unknowns = number_unknowns(problem)
    np.testing.assert_array_equal(unknowns.free, [0, 3, -1, -1, 5])
    assert unknowns.states == {O(0): 1, O(1): 2, O(3): 4, O(2): 6}
    assert unknowns.n_free == 7


def test_states_have_rows_of_zeros_among_those_of_frames(problem: BundleProblem) -> None:
    unknowns = number_unknowns(problem)
    frames = np.random.default_rng(0).normal(size=(5, 6, 2))
    columns = unknowns.to_columns(frames)
    assert columns.shape == (42, 2)
    np.testing.assert_array_equal(columns.reshape(7, 6, 2)[[0, 3, 5]], frames[[0, 1, 4]])
    assert not np.any(columns.reshape(7, 6, 2)[[1, 2, 4, 6]])
    back = unknowns.to_frames(columns)
    np.testing.assert_array_equal(back[[0, 1, 4]], frames[[0, 1, 4]])
    assert not np.any(back[[2, 3]])


def test_empty_columns_are_those_beyond_the_coordinates_of_a_state(problem: BundleProblem) -> None:
    np.testing.assert_array_equal(
        number_unknowns(problem).padding(problem), [9, 10, 11, 13, 14, 15, 16, 17, 39, 40, 41]
    )


def test_places_of_keys(problem: BundleProblem) -> None:
    unknowns = number_unknowns(problem)
    np.testing.assert_array_equal(unknowns.places(problem, [X(4), O(3), X(2), O(0)]), [5, 4, -1, 1])
    with pytest.raises(ValueError, match="pose factor"):
        unknowns.places(problem, [O(9)])

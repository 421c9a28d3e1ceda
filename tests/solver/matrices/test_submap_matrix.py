"""A matrix cut into submaps is the matrix: its factor solves and inverts as numpy does."""

import numpy as np
import pytest
from band_matrices import random_matrix
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.solver.matrices.band_matrix import POSE_DIM, NotPositiveDefiniteError
from vgps.solver.matrices.submap_matrix import SubmapMatrix, cut_into_submaps


def chain(places, reach, frames):
    return cut_into_submaps(places, np.minimum(np.arange(places) + reach, places - 1), frames)


def as_submaps(A, layout, rows):
    matrix = SubmapMatrix.zeros(layout, rows)
    i, j = np.nonzero(np.tril(A))
    matrix.add_entries(i, j, A[i, j])
    return matrix


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(1, 90), st.integers(0, 9), st.integers(1, 20), st.integers(0, 1000))
def test_factor_solves_and_inverts(places, reach, more, seed):
    A, layout = random_matrix(places, reach, seed), chain(places, reach, 2 * reach + more)
    half = POSE_DIM * (reach + 1) - 1
    factor = as_submaps(A, layout, half + 2).cholesky(half)
    right = np.random.default_rng(seed).normal(size=(len(A), 2))
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(A, right), atol=1e-10)
    np.testing.assert_allclose(factor.solve(right[:, 0]), np.linalg.solve(A, right[:, 0]), atol=1e-10)
    inverse = np.linalg.inv(A)
    expected = np.stack([inverse[i : i + POSE_DIM, i : i + POSE_DIM] for i in range(0, len(A), POSE_DIM)])
    np.testing.assert_allclose(factor.inverse_diagonal_blocks(), expected, atol=1e-12)


def test_blocks_that_cross_cuts_add_up_and_touch_nothing_else():
    rng, places, reach = np.random.default_rng(0), 40, 7
    layout, rows = chain(places, reach, 15), POSE_DIM * (reach + 1) + 1
    assert layout.first.tolist() == [0, 15, 40] and layout.separator.tolist() == [0, 7]
    matrix, expected = SubmapMatrix.zeros(layout, rows), np.zeros((240, 240))
    for number in range(60):
        first, size = rng.integers(0, places - reach), rng.integers(3, reach + 2)
        frames = np.arange(first, min(first + size, places))
        frames = np.delete(frames, 1) if number % 3 == 0 else frames
        Z = rng.normal(size=(5, POSE_DIM * len(frames)))
        matrix.subtract_square(frames, Z)
        index = (POSE_DIM * frames[:, None] + np.arange(POSE_DIM)).ravel()
        expected[np.ix_(index, index)] -= Z.T @ Z
    diagonal = rng.normal(size=240)
    matrix.add_diagonal(diagonal)
    expected += np.diag(diagonal)
    found = np.concatenate([part.ab for part in matrix.parts], axis=1)
    i, j = np.tril_indices(240)
    near = i - j < rows
    np.testing.assert_allclose(found[(i - j)[near], j[near]], expected[i[near], j[near]], atol=1e-12)
    outside = np.add.outer(np.arange(rows), np.arange(240)) >= 240
    np.testing.assert_array_equal(found[outside], 0.0)


def test_cuts_lie_where_the_fewest_frames_are_coupled():
    last = np.minimum(np.arange(100) + 6, 99)
    last[:43] = np.minimum(last[:43], 43)  # only frame 43 is coupled with what lies before it
    layout = cut_into_submaps(100, last, 40)
    assert layout.first.tolist() == [0, 43, 100] and layout.separator.tolist() == [0, 1]


def test_there_is_one_submap_where_tracks_are_too_long_to_cut():
    assert chain(100, 8, 15).first.tolist() == [0, 100]
    assert chain(100, 7, 15).first.tolist() == [0, 15, 30, 45, 60, 75, 100]


def test_an_indefinite_matrix_is_refused_at_its_column():
    A = random_matrix(40, 1, 0)
    A[151, 151] = -1.0
    with pytest.raises(NotPositiveDefiniteError) as caught:
        as_submaps(A, chain(40, 1, 10), 13).cholesky(11)
    assert caught.value.column == 151

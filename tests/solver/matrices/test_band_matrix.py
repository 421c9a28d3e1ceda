import numpy as np
import pytest
from band_matrices import random_matrix
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.solver.matrices.band_matrix import POSE_DIM, BandMatrix, NotPositiveDefiniteError


def as_band(A: np.ndarray, rows: int) -> BandMatrix:
    band = BandMatrix.zeros(len(A), rows)
    i, j = np.nonzero(np.tril(A))
    band.add_entries(i, j, A[i, j])
    return band


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 60), st.integers(0, 20), st.integers(0, 1000), st.integers(0, 7))
def test_factor_solves_and_inverts(poses: int, reach: int, seed: int, spare: int) -> None:
    A = random_matrix(poses, reach, seed)
    half = min(POSE_DIM * (reach + 1), POSE_DIM * poses) - 1
    factor = as_band(A, half + 1 + spare).cholesky(half)
    right = np.random.default_rng(seed).normal(size=len(A))
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(A, right), atol=1e-10)
    inverse = np.linalg.inv(A)
    expected = np.stack([inverse[i : i + POSE_DIM, i : i + POSE_DIM] for i in range(0, len(A), POSE_DIM)])
    np.testing.assert_allclose(factor.inverse_diagonal_blocks(), expected, atol=1e-12)


def test_blocks_on_the_diagonal_add_up_and_touch_nothing_else() -> None:
    rng = np.random.default_rng(0)
    expected = np.zeros((30, 30))
    band = BandMatrix.zeros(30, 19)
    for start, size in ((0, 18), (6, 12), (12, 18), (24, 6)):
        block = np.tril(rng.normal(size=(size, size)))
        band.add_lower(start, block)
        expected[start : start + size, start : start + size] += block
    i, j = np.tril_indices(30)
    near = i - j < 19
    np.testing.assert_array_equal(band.ab[(i - j)[near], j[near]], expected[i[near], j[near]])
    outside = np.add.outer(np.arange(19), np.arange(30)) >= 30
    np.testing.assert_array_equal(band.ab[outside], 0.0)


def test_indefinite_matrix_is_refused_at_its_column() -> None:
    A = random_matrix(4, 1, 0)
    A[13, 13] = -1.0
    with pytest.raises(NotPositiveDefiniteError) as caught:
        as_band(A, 12).cholesky(11)
    assert caught.value.column == 13


def test_pivot_of_rounding_size_is_refused() -> None:
    A = np.diag(np.full(12, 4.0))
    A[7, 7] = 1e-15
    with pytest.raises(NotPositiveDefiniteError) as caught:
        as_band(A, 6).cholesky(5, 1e-14 * np.full(12, 4.0))
    assert caught.value.column == 7

"""Products of dense blocks, as new matrices and within larger ones."""

import numpy as np
import pytest

from vgps.solver.matrices.dense_products import (
    block_of_square,
    divide_by_factor,
    subtract_blocks,
    subtract_product,
    subtract_square,
)


@pytest.mark.parametrize("rows", [1, 3, 200])
def test_a_square_is_subtracted_below_the_diagonal_and_nothing_else_is_touched(rows):
    Z = np.random.default_rng(0).normal(size=(rows, 30))
    whole = np.full((50, 40), np.nan, order="F")
    lower = whole[5:35, 7:37]
    i, j = np.tril_indices(30)
    lower[i, j] = 1.0
    subtract_square(Z, lower)
    np.testing.assert_allclose(lower[i, j], (1.0 - Z.T @ Z)[i, j], atol=1e-12)
    assert np.isfinite(whole).sum() == len(i)


@pytest.mark.parametrize(
    ("Z", "lower"),
    [
        (np.zeros((12, 3)).T, np.zeros((12, 12), order="F")),
        (np.zeros((3, 12)), np.zeros((12, 18))),
        (np.zeros((3, 12)), np.zeros((18, 18), order="F")),
        (np.zeros((3, 12)), np.zeros((12, 12), order="F")[:, ::-1]),
    ],
)
def test_other_layouts_are_refused(Z, lower):
    with pytest.raises(ValueError, match="order"):
        subtract_square(Z, lower)


def test_blocks_of_a_square_are_subtracted_where_they_are_stored():
    Z, stored = np.random.default_rng(0).normal(size=(5, 12)), np.ones(200)
    on, off = slice(0, 4), slice(7, 12)
    blocks = block_of_square(on, on, 3, 6), block_of_square(off, on, 50, 10)
    subtract_blocks(Z, blocks, stored)
    expected, squared = np.ones(200), Z.T @ Z
    for i in range(4):
        expected[3 + 6 * i : 4 + 7 * i] -= squared[i, : i + 1]
    for i, row in enumerate(range(7, 12)):
        expected[50 + 10 * i : 54 + 10 * i] -= squared[row, on]
    np.testing.assert_allclose(stored, expected, atol=1e-12)
    with pytest.raises(ValueError, match="order"):
        subtract_blocks(Z.T, blocks, stored)


@pytest.mark.parametrize(("m", "n", "k"), [(1, 1, 1), (7, 4, 5), (200, 96, 30)])
def test_a_product_is_subtracted_in_place(m, n, k):
    rng = np.random.default_rng(0)
    A, B, C = (rng.normal(size=size) for size in ((m, k), (n, k), (m, n)))
    expected = C - A @ B.T
    subtract_product(A, B, C)
    np.testing.assert_allclose(C, expected, atol=1e-12)


def test_division_by_a_factor_reads_its_lower_triangle():
    rng = np.random.default_rng(0)
    lower = np.tril(rng.normal(size=(6, 6))) + 6.0 * np.eye(6)
    B = rng.normal(size=(4, 6))
    quotient, spoilt = B.copy(), lower + np.triu(np.full((6, 6), np.nan), 1)
    divide_by_factor(quotient, spoilt)
    np.testing.assert_allclose(quotient @ lower.T, B, atol=1e-12)


@pytest.mark.parametrize(
    "matrices",
    [
        (np.zeros((4, 3)), np.zeros((2, 3)), np.zeros((2, 4)).T),
        (np.zeros((4, 3)), np.zeros((2, 3)), np.zeros((4, 3))),
        (np.zeros((4, 3)), np.zeros((2, 2)), np.zeros((4, 2))),
        (np.zeros((4, 3)), np.zeros((2, 3)), np.zeros((4, 2), np.float32)),
    ],
)
def test_products_that_do_not_fit_are_refused(matrices):
    with pytest.raises(ValueError, match=r"expected|order"):
        subtract_product(*matrices)


@pytest.mark.parametrize("lower", [np.zeros((2, 2)), np.zeros((3, 3), order="F")[::-1].T])
def test_factors_that_do_not_fit_are_refused(lower):
    with pytest.raises(ValueError, match=r"expected|order"):
        divide_by_factor(np.zeros((4, 3)), lower)

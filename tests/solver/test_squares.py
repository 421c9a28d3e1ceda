"""Products Z^T Z, as new matrices and within larger ones."""

import numpy as np
import pytest

from vgps.solver.squares import square, subtract_square


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
    np.testing.assert_allclose(square(Z, np.empty(1000)), Z.T @ Z, atol=1e-12)


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

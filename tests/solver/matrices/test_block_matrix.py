from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.runtime.threads import one_blas_thread
from vgps.solver.disk_arrays import DiskArrays
from vgps.solver.matrices.band_matrix import POSE_DIM, NotPositiveDefiniteError
from vgps.solver.matrices.block_layout import layout_blocks
from vgps.solver.matrices.block_matrix import BlockSparseMatrix


def random_cliques(frames: int, number: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Return every frame with its successor, and some random sets of frames."""
    chain = [np.array([i, i + 1]) for i in range(frames - 1)] or [np.array([0])]
    far = [np.sort(rng.choice(frames, min(frames, 5), replace=False)) for _ in range(number)]
    return chain + far


def matrix_over(
    frames: int, cliques: list[np.ndarray], rng: np.random.Generator
) -> tuple[np.ndarray, BlockSparseMatrix]:
    """Return a positive definite matrix, dense and in blocks, as a sum of squares over the sets of frames."""
    n = POSE_DIM * frames
    dense, blocks = np.zeros((n, n)), BlockSparseMatrix.zeros(layout_blocks(frames, cliques))
    for clique in cliques:
        J = rng.normal(size=(4, POSE_DIM * len(clique)))
        index = (POSE_DIM * clique[:, None] + np.arange(POSE_DIM)).ravel()
        dense[np.ix_(index, index)] += J.T @ J
        blocks.subtract_square(clique, J)
    np.negative(blocks.flat, out=blocks.flat)
    dense += np.diag(np.full(n, 0.5))
    blocks.add_diagonal(np.full(n, 0.5))
    return dense, blocks


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(st.integers(1, 60), st.integers(0, 12), st.integers(0, 10**6))
def test_factor_solves_and_inverts(frames: int, far: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    dense, blocks = matrix_over(frames, random_cliques(frames, far, rng), rng)
    factor = blocks.cholesky()
    right = rng.normal(size=(len(dense), 3))
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(dense, right), atol=1e-9)
    np.testing.assert_allclose(factor.solve(right[:, 0]), np.linalg.solve(dense, right[:, 0]), atol=1e-9)
    inverse = np.linalg.inv(dense)
    expected = np.stack([inverse[i : i + POSE_DIM, i : i + POSE_DIM] for i in range(0, len(dense), POSE_DIM)])
    np.testing.assert_allclose(factor.inverse_diagonal_blocks(), expected, atol=1e-10)


def test_entries_land_where_squares_do() -> None:
    rng = np.random.default_rng(3)
    frames, cliques = 30, random_cliques(30, 5, rng)
    dense, blocks = matrix_over(frames, cliques, rng)
    again = BlockSparseMatrix.zeros(blocks.layout)
    i, j = np.nonzero(np.tril(dense))
    again.add_entries(i, j, dense[i, j])
    right = rng.normal(size=len(dense))
    np.testing.assert_allclose(again.cholesky().solve(right), np.linalg.solve(dense, right), atol=1e-10)


@pytest.mark.slow
def test_factor_does_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    _, blocks = matrix_over(200, random_cliques(200, 12, rng), rng)
    factors = []
    for cores in (1, 2, 5):
        monkeypatch.setattr("vgps.runtime.threads.usable_cores", lambda cores=cores: cores)
        with one_blas_thread():
            factors.append(blocks.cholesky().flat)
    np.testing.assert_array_equal(factors[0], factors[1])
    np.testing.assert_array_equal(factors[0], factors[2])


@pytest.mark.parametrize("cores", [1, 2])
def test_undetermined_variable_is_refused_at_its_column(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vgps.runtime.threads.usable_cores", lambda: cores)
    rng = np.random.default_rng(0)
    cliques = random_cliques(90, 3, rng)
    dense, _ = matrix_over(90, cliques, rng)
    dense[POSE_DIM * 45 + 2] = dense[:, POSE_DIM * 45 + 2] = 0.0
    blocks = BlockSparseMatrix.zeros(layout_blocks(90, cliques))
    i, j = np.nonzero(np.tril(dense))
    blocks.add_entries(i, j, dense[i, j])
    with pytest.raises(NotPositiveDefiniteError) as refusal:
        blocks.cholesky()
    assert refusal.value.column == POSE_DIM * 45 + 2


def test_pivot_below_the_minimum_is_refused() -> None:
    blocks = BlockSparseMatrix.zeros(layout_blocks(19, [np.arange(19)]))
    diagonal = np.ones(POSE_DIM * 19)
    diagonal[POSE_DIM * 17] = 1e-15
    blocks.add_diagonal(diagonal)
    assert np.diagonal(blocks.cholesky().block(1, 1))[POSE_DIM] == pytest.approx(1e-15**0.5)
    with pytest.raises(NotPositiveDefiniteError) as refusal:
        blocks.cholesky(np.full(POSE_DIM * 19, 1e-14))
    assert refusal.value.column == POSE_DIM * 17


def test_matrix_and_factor_on_disk_leave_the_memory_column_by_column(monkeypatch: pytest.MonkeyPatch) -> None:
    told: Counter[DiskArrays] = Counter()
    monkeypatch.setattr(DiskArrays, "passed", lambda arrays, _: told.update([arrays]))
    layout = layout_blocks(90, random_cliques(90, 0, np.random.default_rng(0)))
    blocks = BlockSparseMatrix.zeros(layout, on_disk=True)
    blocks.add_diagonal(np.ones(layout.columns))
    assert blocks.arrays is not None
    told.clear()
    factor = blocks.cholesky()
    assert factor.arrays is not None
    assert min(told[blocks.arrays], told[factor.arrays]) >= len(layout.order)

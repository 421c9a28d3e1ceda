import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.solver.band_matrix import POSE_DIM, NotPositiveDefiniteError
from vgps.solver.block_layout import BLOCK_FRAMES, layout_blocks
from vgps.solver.block_matrix import BlockSparseMatrix


def random_cliques(frames: int, number: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Every frame with its successor, and some sets of frames from anywhere."""
    chain = [np.array([i, i + 1]) for i in range(frames - 1)] or [np.array([0])]
    far = [np.sort(rng.choice(frames, min(frames, 5), replace=False)) for _ in range(number)]
    return chain + far


def matrix_over(
    frames: int, cliques: list[np.ndarray], rng: np.random.Generator
) -> tuple[np.ndarray, BlockSparseMatrix]:
    """A positive definite matrix, whole and in tiles, as a sum of squares over the sets of frames."""
    n = POSE_DIM * frames
    whole, tiles = np.zeros((n, n)), BlockSparseMatrix.zeros(layout_blocks(frames, cliques))
    for clique in cliques:
        J = rng.normal(size=(4, POSE_DIM * len(clique)))
        index = (POSE_DIM * clique[:, None] + np.arange(POSE_DIM)).ravel()
        whole[np.ix_(index, index)] += J.T @ J
        tiles.add_square(clique, np.tril(J.T @ J))
    whole += np.diag(np.full(n, 0.5))
    tiles.add_diagonal(np.full(n, 0.5))
    return whole, tiles


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 90), st.integers(0, 12), st.integers(0, 10**6))
def test_factor_solves_and_inverts(frames: int, far: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    whole, tiles = matrix_over(frames, random_cliques(frames, far, rng), rng)
    factor = tiles.cholesky()
    right = rng.normal(size=(len(whole), 3))
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(whole, right), atol=1e-9)
    np.testing.assert_allclose(factor.solve(right[:, 0]), np.linalg.solve(whole, right[:, 0]), atol=1e-9)
    inverse = np.linalg.inv(whole)
    expected = np.stack([inverse[i : i + POSE_DIM, i : i + POSE_DIM] for i in range(0, len(whole), POSE_DIM)])
    np.testing.assert_allclose(factor.inverse_diagonal_blocks(), expected, atol=1e-10)


def test_entries_land_where_squares_do() -> None:
    rng = np.random.default_rng(3)
    frames, cliques = 30, random_cliques(30, 5, rng)
    whole, tiles = matrix_over(frames, cliques, rng)
    again = BlockSparseMatrix.zeros(tiles.layout)
    i, j = np.nonzero(np.tril(whole))
    again.add_entries(i, j, whole[i, j])
    right = rng.normal(size=len(whole))
    np.testing.assert_allclose(again.cholesky().solve(right), np.linalg.solve(whole, right), atol=1e-10)


def test_a_loop_costs_little_and_a_band_would_be_full() -> None:
    """A chain that ends where it began: fill of a column of two tiles, not of all."""
    tiles = 40
    frames = np.arange(tiles * BLOCK_FRAMES)
    chain = [np.array([i, i + 1]) for i in frames[:-1]]
    layout = layout_blocks(len(frames), [*chain, frames[[0, -1]]])
    assert max(len(below) for below in layout.below) == 2
    width = POSE_DIM * BLOCK_FRAMES
    assert layout.flops < tiles * width**3 * (1 / 3 + 2 + 4)
    assert sorted(layout.order.tolist()) == list(range(tiles))


def test_the_order_is_of_least_degree() -> None:
    """A star: the middle tile, which all others touch, is eliminated last or last but one; nothing fills."""
    middle = 3 * BLOCK_FRAMES
    rays = [np.array(sorted((middle, BLOCK_FRAMES * i))) for i in range(8) if i != 3]
    layout = layout_blocks(8 * BLOCK_FRAMES, rays)
    assert layout.rank[3] >= 6
    assert max(len(below) for below in layout.below) == 1


def test_what_nothing_ties_is_told_by_its_column() -> None:
    rng = np.random.default_rng(0)
    cliques = random_cliques(20, 3, rng)
    whole, _ = matrix_over(20, cliques, rng)
    whole[POSE_DIM * 13 + 2] = whole[:, POSE_DIM * 13 + 2] = 0.0
    tiles = BlockSparseMatrix.zeros(layout_blocks(20, cliques))
    i, j = np.nonzero(np.tril(whole))
    tiles.add_entries(i, j, whole[i, j])
    with pytest.raises(NotPositiveDefiniteError) as refusal:
        tiles.cholesky()
    assert refusal.value.column == POSE_DIM * 13 + 2


def test_a_pivot_below_the_least_is_refused() -> None:
    tiles = BlockSparseMatrix.zeros(layout_blocks(3, [np.array([0, 1, 2])]))
    diagonal = np.ones(18)
    diagonal[7] = 1e-15
    tiles.add_diagonal(diagonal)
    assert np.diagonal(tiles.cholesky().block(0, 0))[7] == pytest.approx(1e-15**0.5)
    with pytest.raises(NotPositiveDefiniteError) as refusal:
        tiles.cholesky(1e-14 * np.ones(18))
    assert refusal.value.column == 7

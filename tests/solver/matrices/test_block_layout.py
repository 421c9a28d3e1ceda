import numpy as np

from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.matrices.block_layout import BLOCK_FRAMES, layout_blocks


def test_closing_a_loop_adds_one_block_per_column() -> None:
    """A chain that ends where it began: each column has two blocks, where a band would be full."""
    blocks = 40
    frames = np.arange(blocks * BLOCK_FRAMES)
    chain = [np.array([i, i + 1]) for i in frames[:-1]]
    layout = layout_blocks(len(frames), [*chain, frames[[0, -1]]])
    assert max(len(below) for below in layout.below) == 2
    width = POSE_DIM * BLOCK_FRAMES
    assert layout.flops < blocks * width**3 * (1 / 3 + 2 + 4)
    assert sorted(layout.order.tolist()) == list(range(blocks))


def test_star_is_eliminated_from_its_rays() -> None:
    """The middle block, coupled with all others, comes last or last but one, and nothing fills."""
    middle = 3 * BLOCK_FRAMES
    rays = [np.array(sorted((middle, BLOCK_FRAMES * i))) for i in range(8) if i != 3]
    layout = layout_blocks(8 * BLOCK_FRAMES, rays)
    assert layout.rank[3] >= 6
    assert max(len(below) for below in layout.below) == 1


def test_blocks_are_stored_without_overlap_in_panels() -> None:
    """The last block is narrower; every column is a panel of its blocks in order of elimination."""
    frames = 2 * BLOCK_FRAMES + 3
    layout = layout_blocks(frames, [np.array([0, BLOCK_FRAMES]), np.array([0, 2 * BLOCK_FRAMES])])
    assert [layout.width(i) for i in range(3)] == [POSE_DIM * BLOCK_FRAMES, POSE_DIM * BLOCK_FRAMES, 18]
    assert layout.span(2) == slice(2 * POSE_DIM * BLOCK_FRAMES, POSE_DIM * frames)
    at = 0
    for column in layout.order.tolist():
        for row in (column, *layout.below[column].tolist()):
            assert layout.start[row, column] == at
            at += layout.width(row) * layout.width(column)
    assert at == layout.size
    assert np.count_nonzero(layout.start >= 0) == 5  # three diagonal blocks and the two couplings


def test_contributions_are_the_products_of_blocks_that_two_columns_share() -> None:
    """Summed over the earlier columns, they are all of L L^T but the squares of the diagonal blocks."""
    rng = np.random.default_rng(0)
    frames = np.arange(7 * BLOCK_FRAMES + 5)
    far = [np.sort(rng.choice(frames, 3, replace=False)) for _ in range(4)]
    layout = layout_blocks(len(frames), [*(np.array([i, i + 1]) for i in frames[:-1]), *far])
    factor = rng.normal(size=layout.size)
    dense = np.zeros((layout.columns, layout.columns))
    rows_of = {}
    for k in layout.order.tolist():
        span = np.arange(layout.span(k).start, layout.span(k).stop)
        rows_of[k] = np.append(span, layout.rows_below(k))
        dense[np.ix_(rows_of[k], span)] = layout.column(k, factor)
    for k in layout.order.tolist():
        total = np.zeros((len(rows_of[k]), layout.width(k)))
        for earlier, first, runs in layout.contributions[k]:
            panel = layout.column(earlier, factor)
            for rows, at in runs:
                total[at] += panel[rows] @ panel[first : first + layout.width(k)].T
        earlier = layout.order[: layout.rank[k]].tolist()
        before = np.concatenate([rows_of[j][: layout.width(j)] for j in earlier] or [rows_of[k][:0]])
        span = rows_of[k][: layout.width(k)]
        expected = dense[np.ix_(rows_of[k], before)] @ dense[np.ix_(span, before)].T
        np.testing.assert_allclose(total, expected, atol=1e-12)

"""Cholesky's factorisation of a block-sparse matrix, a thread for each usable core.

Each column of blocks subtracts what the columns before it contribute, in their order, and is then divided by
its own factor (left-looking). It waits for each of them only when their turn comes, so that threads work on
several columns at once, independent ones or not, and the result does not depend on their number.
"""

from collections.abc import Callable
from threading import Event

import numpy as np
from scipy.linalg import lapack

from vgps.model import FloatArray
from vgps.runtime.threads import map_in_order
from vgps.solver.matrices.band_matrix import NotPositiveDefiniteError
from vgps.solver.matrices.block_layout import BlockLayout
from vgps.solver.matrices.dense_products import divide_by_factor, subtract_product


def factorise_blocks(
    layout: BlockLayout,
    matrix: FloatArray,
    factor: FloatArray,
    least: FloatArray,
    passed: Callable[[int], None],
) -> None:
    """Write the factor L of A = L L^T, in order of elimination.

    Args:
        layout: The stored blocks.
        matrix: (layout.size,) entries of A.
        factor: (layout.size,) those of L, for the result.
        least: (n,) what the squared pivots must exceed.
        passed: Called with how many bytes of both were in use and may leave the memory.

    Raises:
        NotPositiveDefiniteError: There is no factor, or a squared pivot is not above its least value.
    """
    columns = {k: layout.column(k, factor) for k in layout.order.tolist()}
    finished = {k: Event() for k in columns}

    def factorise(k: int) -> None:
        try:
            width, column = layout.width(k), columns[k]
            column[:] = layout.column(k, matrix)
            for earlier, first, runs in layout.contributions[k]:
                finished[earlier].wait()
                panel = columns[earlier]
                for rows, at in runs:
                    subtract_product(panel[rows], panel[first : first + width], column[at])
                passed(panel.nbytes)
            _factorise_diagonal(column[:width], layout.span(k), least)
            divide_by_factor(column[width:], column[:width])
            passed(2 * column.nbytes)
        finally:
            finished[k].set()  # after an error too, which the caller gets before those of later columns

    for _ in map_in_order(factorise, list(columns)):
        pass


def _factorise_diagonal(block: FloatArray, span: slice, least: FloatArray) -> None:
    lower, info = lapack.dpotrf(block, lower=1)
    if info > 0:
        raise NotPositiveDefiniteError(span.start + info - 1)
    small = ~(np.diagonal(lower) ** 2 > least[span])  # true of NaN as well
    if np.any(small):
        raise NotPositiveDefiniteError(span.start + int(np.argmax(small)))
    block[:] = lower

"""The cross product as a matrix."""

import numpy as np

from vgps.model import FloatArray


def cross_matrices(vectors: FloatArray) -> FloatArray:
    """Return the matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    out = np.zeros((*vectors.shape[:-1], 3, 3))
    for row, column, axis in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., row, column], out[..., column, row] = -vectors[..., axis], vectors[..., axis]
    return out

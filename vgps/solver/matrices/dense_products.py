"""Products of dense blocks, during which other threads run; SciPy's wrappers of BLAS hold them up."""

import ctypes
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cython_blas

from vgps.model import FloatArray

_name_of = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(("PyCapsule_GetName", ctypes.pythonapi))
_address_of = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)


def _routine(capsule: object, arguments: int) -> "ctypes._FuncPointer":
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)(_address_of(capsule, _name_of(capsule)))


_dsyrk = _routine(cython_blas.__pyx_capi__["dsyrk"], 10)
_dgemm = _routine(cython_blas.__pyx_capi__["dgemm"], 13)
_dtrsm = _routine(cython_blas.__pyx_capi__["dtrsm"], 11)
_MINUS, _PLUS = (ctypes.byref(ctypes.c_double(factor)) for factor in (-1.0, 1.0))


class BlockOfSquare(NamedTuple):
    """A block of a square Z^T Z, and where it goes among stored entries, in C order.

    Attributes:
        row, column: Bytes from the first column of Z to those of its rows, and to those of its columns.
        start: Bytes from the first stored entry to its own first.
        sizes: Its rows and columns, and the stored entries from one row to the next, for BLAS.
    """

    row: int
    column: int
    start: int
    sizes: tuple[object, ...]


def block_of_square(rows: slice, columns: slice, start: int, stride: int) -> BlockOfSquare:
    """Return the block of some rows and columns, whose first entry is stored at ``start``."""
    sizes = _sizes(rows.stop - rows.start, columns.stop - columns.start, stride)
    return BlockOfSquare(8 * rows.start, 8 * columns.start, 8 * start, sizes)


def subtract_square(Z: FloatArray, lower: FloatArray) -> None:
    """Subtract Z^T Z in place, on and below the diagonal; what lies above it is neither read nor written.

    Args:
        Z: (k, n) in C order.
        lower: (n, n) view of a matrix in Fortran order.

    Raises:
        ValueError: They are not laid out in this way.
    """
    (k, n), (down, across) = Z.shape, lower.strides
    if not (Z.flags.c_contiguous and lower.shape == (n, n) and down == 8 and across >= 8 * n):
        raise ValueError("Z is not in C order, or the matrix not in Fortran order and of its size")
    columns, rows, stride = _sizes(n, k, across // 8)
    a, c = Z.ctypes.data, lower.ctypes.data
    _dsyrk(b"L", b"N", columns, rows, _MINUS, a, columns, _PLUS, c, stride)


def subtract_blocks(Z: FloatArray, blocks: Sequence[BlockOfSquare], target: FloatArray) -> None:
    """Subtract blocks of Z^T Z in place; of one on the diagonal, what lies on it and below.

    Args:
        Z: (k, n) in C order.
        blocks: Where they are, in a square of n columns.
        target: Contiguous entries, which hold the places of all blocks.

    Raises:
        ValueError: They are not laid out in this way.
    """
    _check_order(Z, target)
    (width, depth), z, to = _sizes(Z.shape[1], len(Z)), Z.ctypes.data, target.ctypes.data
    for row, column, start, sizes in blocks:
        m, n, stride = sizes
        if row == column:
            _dsyrk(b"U", b"N", n, depth, _MINUS, z + column, width, _PLUS, to + start, stride)
        else:
            arguments = b"N", b"T", n, m, depth, _MINUS, z + column, width, z + row, width, _PLUS
            _dgemm(*arguments, to + start, stride)


def subtract_product(A: FloatArray, B: FloatArray, C: FloatArray) -> None:
    """Subtract A B^T from C (m, n) in place, for A (m, k) and B (n, k), all in C order.

    Raises:
        ValueError: They are not laid out in this way.
    """
    (m, k), n = A.shape, len(B)
    _check_order(A, B, C)
    if B.shape != (n, k) or C.shape != (m, n):
        raise ValueError(f"C is {C.shape} and B {B.shape}, expected {(m, n)} and {(n, k)}")
    rows, columns, depth = _sizes(m, n, k)
    a, b, c = A.ctypes.data, B.ctypes.data, C.ctypes.data
    _dgemm(b"T", b"N", columns, rows, depth, _MINUS, b, depth, a, depth, _PLUS, c, columns)


def divide_by_factor(B: FloatArray, lower: FloatArray) -> None:
    """Replace B (m, n) by B L^-T in place, for L (n, n) of which the lower triangle is read, both in C order.

    Raises:
        ValueError: They are not laid out in this way.
    """
    m, n = B.shape
    _check_order(B, lower)
    if lower.shape != (n, n):
        raise ValueError(f"L is {lower.shape}, expected {(n, n)}")
    rows, columns = _sizes(m, n)
    _dtrsm(b"L", b"U", b"T", b"N", columns, rows, _PLUS, lower.ctypes.data, columns, B.ctypes.data, columns)


def _sizes(*sizes: int) -> tuple[object, ...]:
    # integers of 64 bits, of which BLAS may read the lower 32 only
    return tuple(ctypes.byref(ctypes.c_int64(size)) for size in sizes)


def _check_order(*matrices: FloatArray) -> None:
    if not all(matrix.flags.c_contiguous and matrix.dtype == np.float64 for matrix in matrices):
        raise ValueError("a matrix is not in C order, or not of 64 bit floats")

"""Products Z^T Z of dense matrices, during which other threads run; SciPy's wrappers of BLAS hold them up."""

import ctypes

import numpy as np
from scipy.linalg import cython_blas

from vgps.model import FloatArray

_name_of = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(("PyCapsule_GetName", ctypes.pythonapi))
_address_of = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)
_CAPSULE = cython_blas.__pyx_capi__["dsyrk"]
_dsyrk = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 10)(_address_of(_CAPSULE, _name_of(_CAPSULE)))


def square(Z: FloatArray, scratch: FloatArray) -> FloatArray:
    """Return Z^T Z, (n, n), for Z (k, n), in the scratch memory."""
    n = Z.shape[1]
    return np.matmul(Z.T, Z, out=scratch[: n * n].reshape(n, n))


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
    # integers of 64 bits, of which BLAS may read the lower 32 only
    columns, rows, stride = (ctypes.byref(ctypes.c_int64(size)) for size in (n, k, across // 8))
    minus, plus = (ctypes.byref(ctypes.c_double(factor)) for factor in (-1.0, 1.0))
    a, c = Z.ctypes.data, lower.ctypes.data
    _dsyrk(b"L", b"N", columns, rows, minus, a, columns, plus, c, stride)

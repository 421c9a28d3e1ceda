"""An array to which rows are appended one by one."""

import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray

_START = 256  # rows allocated at first


def read_only(values: FloatArray) -> FloatArray:
    """Return a view of an array that cannot be written to."""
    view = values.view()
    view.flags.writeable = False
    return view


class GrowingArray:
    """Float rows of one shape; memory doubles when it is full, so appending n rows costs O(n).

    Args:
        shape: Shape of a row: ``()`` for numbers, ``(4, 4)`` for poses.
    """

    def __init__(self, shape: tuple[int, ...] = ()) -> None:
        self._rows = np.zeros((_START, *shape))
        self._count = 0

    @classmethod
    def of(cls, rows: FloatArray) -> "GrowingArray":
        """Return an array of these rows (n, *shape), copied."""
        made = cls(rows.shape[1:])
        made._rows = np.concatenate([rows, np.zeros((max(_START, len(rows) // 2), *rows.shape[1:]))])
        made._count = len(rows)
        return made

    def __len__(self) -> int:
        return self._count

    @property
    def values(self) -> FloatArray:
        """(n, *shape) rows so far; a view that may be written to until the next row is appended."""
        return self._rows[: self._count]

    def append(self, row: npt.ArrayLike) -> None:
        """Append a row."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        self._rows[self._count] = row
        self._count += 1

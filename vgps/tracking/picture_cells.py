"""The grid of cells over the picture in which features start, one in each."""

from dataclasses import replace

import cv2
import numpy as np

from vgps.model import BoolArray, FloatArray, Frame, IntArray


class PictureCells:
    """Square cells over a picture.

    Attributes:
        shape: Number of rows and of columns.

    Args:
        size_px: Height and width of the picture.
        side_px: Side of a cell.
    """

    def __init__(self, size_px: tuple[int, int], side_px: float) -> None:
        self._size, self._side = size_px, side_px
        self.shape = tuple(int(np.ceil(size / side_px)) for size in size_px)

    def of(self, raw_uv_px: FloatArray) -> tuple[IntArray, IntArray]:
        """Return the row and the column of the cell of each pixel (N, 2), the nearest of one outside."""
        row, column = np.clip((raw_uv_px[:, ::-1] / self._side).astype(int), 0, np.subtract(self.shape, 1)).T
        return row, column

    def counts(self, raw_uv_px: FloatArray) -> FloatArray:
        """Return (R, C) how many pixels (N, 2) lie in each cell."""
        counts = np.zeros(self.shape)
        np.add.at(counts, self.of(raw_uv_px), 1.0)
        return counts

    def summed(self, values: FloatArray, side: int) -> FloatArray:
        """Return (R, C) the sums of values (R, C) over a square of cells around each."""
        return np.asarray(
            cv2.boxFilter(values, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
        )

    def boxes(self, first: IntArray, last: IntArray) -> IntArray:
        """Return left, top, right, bottom (n, 4) in pixels of blocks of cells.

        Args:
            first, last: (n, 2) row and column of their first cells, and of those after their last ones.
        """
        corners = np.floor(self._side * np.hstack([first[:, ::-1], last[:, ::-1]]))
        return np.asarray(np.minimum(corners, np.tile(self._size[::-1], 2)), dtype=np.int64)

    def without(self, frame: Frame, left_out: BoolArray) -> Frame:
        """Return a frame with some cells (R, C) left out of its mask."""
        if not left_out.any():
            return frame
        row, column = ((np.arange(size) / self._side).astype(int) for size in self._size)
        shown = ~left_out[row][:, column]
        return replace(frame, mask=shown if frame.mask is None else shown & frame.mask)

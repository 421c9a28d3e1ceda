"""The map: landmarks, and their observations in the frames."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.model import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Observations:
    """Landmarks observed in frames: ``frame`` (N,), ``landmark`` (N,) row of the landmarks, ``uv_px`` (N, 2)
    in the undistorted (pinhole) image."""

    frame: IntArray
    landmark: IntArray
    uv_px: FloatArray

    def rows(self, rows: IntArray | BoolArray) -> "Observations":
        """Return some of the observations, in the order given."""
        return Observations(self.frame[rows], self.landmark[rows], self.uv_px[rows])

    @staticmethod
    def stacked(parts: "Sequence[Observations]") -> "Observations":
        """Return all observations of one map, one part after the other."""
        return Observations(*_columns(parts))


@dataclass(frozen=True)
class Landmarks:
    """Points of the map.

    Attributes:
        world_p_landmark: (L, 3) metres.
        sigma_px: (L,) reliability sigma_j, Eq. (13), Kume 2010, pixels.
        gray: (L,) luminance in the first observation, uint8.
    """

    world_p_landmark: FloatArray
    sigma_px: FloatArray
    gray: npt.NDArray[np.uint8]

    @staticmethod
    def stacked(parts: "Sequence[Landmarks]") -> "Landmarks":
        """Return the landmarks of several maps, one map after the other."""
        return Landmarks(*_columns(parts))


def _columns(parts: Sequence[Observations] | Sequence[Landmarks]) -> Iterator[npt.NDArray[Any]]:
    """Yield the concatenated arrays of each field."""
    for column in fields(parts[0]):
        yield np.concatenate([getattr(part, column.name) for part in parts])

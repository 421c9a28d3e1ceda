"""The last digits in which a log states positions: a receiver knows them better than its log."""

import numpy as np

from vgps.model import BoolArray, FloatArray

_DEGREE_M = 111_000.0
_ANGLES_DEG = np.append(10.0 ** -np.arange(3.0, 8.0), 10.0 ** -np.arange(2.0, 6.0) / 60.0)
"""Steps of decimal degrees and minutes of a centimetre and more: what is finer no receiver knows."""
_HEIGHTS_M = 10.0 ** -np.arange(3.0)
_TOLERANCE = 1e-3  # of a step: minutes that a program made degrees of ten decimals err by less
_FLAT = 1e-8  # of a step: the height of a flat path varies by more, and nothing was converted
_UNIFORM = 12.0**-0.5  # standard deviation of an error that is uniform over a step


class LastDigits:
    """The largest steps of which all positions so far are multiples."""

    def __init__(self) -> None:
        self._angles = np.ones(len(_ANGLES_DEG), dtype=bool)
        self._heights = np.ones(len(_HEIGHTS_M), dtype=bool)
        self._latitude_deg = 0.0

    def add(self, latitude_deg: FloatArray, longitude_deg: FloatArray, height_m: FloatArray) -> "LastDigits":
        """Add positions (N,); heights without a geoid's that was added to them. Return this."""
        self._angles &= _multiples(np.append(latitude_deg, longitude_deg), _ANGLES_DEG, _TOLERANCE)
        self._heights &= _multiples(np.atleast_1d(height_m), _HEIGHTS_M, _FLAT)
        self._latitude_deg = float(np.max(latitude_deg, initial=-90.0))
        return self

    @property
    def steps_m(self) -> FloatArray:
        """(3,) steps east, north and up [m], 0 if they are below a centimetre."""
        north_m = _DEGREE_M * float(_ANGLES_DEG[self._angles].max(initial=0.0))
        east_m = north_m * float(np.cos(np.radians(self._latitude_deg)))
        return np.array([east_m, north_m, _HEIGHTS_M[self._heights].max(initial=0.0)])

    @property
    def rounding_m(self) -> FloatArray:
        """(3,) standard deviations of the errors of rounding, east, north and up [m]."""
        return _UNIFORM * self.steps_m


def _multiples(values: FloatArray, steps: FloatArray, tolerance: float) -> BoolArray:
    """Return of which steps (S,) all values (N,) are multiples, to some part of them."""
    whole = values[:, None] / steps
    return np.asarray((np.abs(whole - np.round(whole)) < tolerance).all(axis=0))

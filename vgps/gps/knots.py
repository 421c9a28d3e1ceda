"""Values at knots, between which they change evenly."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vgps.gps.antenna_path import Placement
from vgps.model import FloatArray

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Knots:
    """Linear interpolation at n times between ``count`` knots, K.

    The search of a grid of time offsets solves for the knots thousands of times: products of sparse matrices
    would take several times as long.
    """

    at: Placement
    count: int

    def interpolated(self, values: ComplexArray) -> ComplexArray:
        """Return the values (..., n) at the times from those (..., K) at the knots."""
        before, after = values[..., self.at.frame], values[..., self.at.frame + 1]
        return np.asarray((1.0 - self.at.alpha) * before + self.at.alpha * after)

    def sums(self, values: ComplexArray) -> ComplexArray:
        """Return the sums (..., K) of values (..., n) with the weights of the knots."""
        return np.asarray(self._sums(values.real) + 1j * self._sums(values.imag))

    def normal_band(self, weight: FloatArray) -> FloatArray:
        """Return the upper bands (2, ..., K) of the normal matrices of values of weights (..., n)."""
        band, alpha = np.zeros((2, *weight.shape[:-1], self.count)), self.at.alpha
        band[0, ..., 1:] = self._at_frame(weight * alpha * (1.0 - alpha))[..., :-1]
        band[1] = self._at_frame(weight * (1.0 - alpha) ** 2)
        band[1, ..., 1:] += self._at_frame(weight * alpha**2)[..., :-1]
        return band

    def _sums(self, values: FloatArray) -> FloatArray:
        sums = self._at_frame(values * (1.0 - self.at.alpha))
        sums[..., 1:] += self._at_frame(values * self.at.alpha)[..., :-1]
        return sums

    def _at_frame(self, values: FloatArray) -> FloatArray:
        """Return the sums (..., K) of values (..., n) by the knot before them."""
        lead = values.shape[:-1]
        rows = int(np.prod(lead))
        at = self.at.frame + self.count * np.arange(rows)[:, None]
        sums = np.bincount(at.ravel(), values.ravel(), rows * self.count)
        return np.asarray(sums.reshape(*lead, self.count), np.float64)

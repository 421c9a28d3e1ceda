"""Displacements between successive fixes, compared with those of the camera at a time offset."""

import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from vgps.config import TimeOffsetConfig
from vgps.geometry.path_smoothing import smoothed
from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes
from vgps.gps.frame_gaps import in_gaps
from vgps.gps.knots import ComplexArray, Knots
from vgps.gps.sensors import TimeOffset
from vgps.model import FloatArray, IntArray
from vgps.solution import Trajectory

MIN_SPREAD_M = 0.005  # for differences that agree exactly, as simulated ones may
MEDIAN = 1.1774  # length of a Gaussian vector in the plane, in standard deviations per axis
_PAIRS_OF_ALL = 3.0  # that the spread of all pairs counts as beside those of a class
_DELTA_S = 0.01  # step of the difference quotient
_REWEIGHTINGS = 2  # within each step of the time offset


def neighbour_pairs(
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    prior: TimeOffset,
    config: TimeOffsetConfig,
) -> "NeighbourPairs":
    """Return the pairs of fixes that are within the video for every time offset searched.

    A gap between frames is none of it: there the path is a guess.

    Args:
        path: In the world, at approximately the right scale.
        fixes: Fixes at the times of their time stamps; used ones are paired.
        camera_p_antenna: (3,) metres.
        prior: Prior of the time offset.
        config: Selection and comparison of pairs.
    """
    t_s, reach = fixes.t_s - prior.time_offset_s, config.search_sigmas * prior.sigma_s
    within = (t_s > path.t_s[0] + reach) & (t_s < path.t_s[-1] - reach) & ~in_gaps(path.t_s, t_s, reach)
    searched = fixes.where(fixes.used & within)
    alike = np.diff(searched.fix_class) == 0
    rows = np.flatnonzero(alike & (np.diff(searched.t_s) <= config.max_pair_s))
    return NeighbourPairs(path, searched, camera_p_antenna, rows, config)


class NeighbourPairs:
    """Pairs of successive fixes; ``rows`` (n,) are the first of each.

    Horizontal displacements are complex numbers, so that a complex factor rotates and scales them. For time
    offsets (...,) at once, arrays over pairs or knots have these axes before their own.
    """

    def __init__(
        self,
        path: Trajectory,
        fixes: Fixes,
        camera_p_antenna: FloatArray,
        rows: IntArray,
        config: TimeOffsetConfig,
    ) -> None:
        self.config = config
        poses = path.world_T_camera
        antenna = poses[:, :3, :3] @ camera_p_antenna + poses[:, :3, 3]
        # interpolation between frames halves the variance of jitter, which would look like a time offset
        smooth = smoothed(antenna)
        self._antenna: ComplexArray = smooth[:, 0] + 1j * smooth[:, 1]
        self._path, self._fixes, self._rows = path, fixes, rows
        _, self._group, self._group_size = np.unique(
            fixes.fix_class[rows], return_inverse=True, return_counts=True
        )
        self._rows_of_group = [np.flatnonzero(self._group == k) for k in range(len(self._group_size))]
        t_s = path.t_s
        self._displacement = np.diff(fixes.world_p_fix[:, 0] + 1j * fixes.world_p_fix[:, 1])[self._rows]
        knots = np.linspace(t_s[0], t_s[-1], 2 + int(np.ptp(t_s) / config.knot_s))
        self._knots = Knots(place(knots, fixes.t_s[self._rows]), len(knots))
        # the inverse of the factors' prior covariance, apart**2 * I + common**2 * 1 1', is
        # I / apart**2 - shared * 1 1'
        apart, common = config.factor_sigma**2, config.common_factor_sigma**2
        self._information_of_one = 1.0 / (apart + len(knots) * common)
        self._shared = common / apart * self._information_of_one

    @property
    def count(self) -> int:
        """Number of pairs."""
        return len(self._rows)

    @property
    def degrees_of_freedom(self) -> int:
        """Number of residuals minus that of the factors' parameters and the time offset."""
        return 2 * self.count - 2 * self._knots.count - 1

    @property
    def interval_s(self) -> FloatArray:
        """(n,) times from one fix of a pair to the other."""
        return np.asarray(np.diff(self._fixes.t_s)[self._rows])

    @property
    def length_m(self) -> FloatArray:
        """(n,) distances of the antenna from one fix of a pair to the other, as the camera sees them."""
        return np.abs(self._camera_displacement(0.0))

    def absorbed(self) -> float:
        """Return how many residuals the factors take up, as far as their prior leaves these free (MacKay,
        Bayesian Interpolation, Neural Computation 4, 1992)."""
        fit = self._fitted(0.0)
        band = self._band(fit.displacement, self._weight(fit.difference))
        apart = solveh_banded(band, np.eye(self._knots.count))
        common = apart.sum(axis=0)
        covariance = apart + self._shared / (1.0 - self._shared * common.sum()) * np.outer(common, common)
        kept = np.trace(covariance) / self.config.factor_sigma**2 - self._shared * covariance.sum()
        return 2.0 * float(self._knots.count - kept)

    def at_times(self, t_s: FloatArray) -> "NeighbourPairs":
        """Return the same pairs with other times (M,) of their fixes, such as those of another clock."""
        moved = copy.copy(self)
        moved._fixes = replace(self._fixes, t_s=t_s)
        return moved

    @property
    def fix_times_s(self) -> FloatArray:
        """(M,) times of the fixes, those that are in no pair included."""
        return self._fixes.t_s

    def difference(self, time_offset_s: FloatArray | float) -> FloatArray:
        """Return the lengths (..., n) of the differences at time offsets (...,), metres."""
        return np.abs(self._fitted(time_offset_s).difference)

    def step(self, time_offset_s: float, prior: TimeOffset) -> tuple[float, float]:
        """Return the Gauss-Newton step of the reweighted problem, and the marginal standard deviation."""
        fit = self._fitted(time_offset_s)
        by_time_offset = (
            (self._camera_displacement(time_offset_s + _DELTA_S) - fit.displacement)
            / _DELTA_S
            * self._knots.interpolated(fit.factor)
        )
        weight = self._weight(fit.difference)
        shared = self._knots.sums(weight * fit.displacement.conj() * by_time_offset)
        absorbed = np.vdot(shared, self._solved(fit.displacement, weight, shared)).real  # by the factors
        information = np.sum(weight * np.abs(by_time_offset) ** 2) - absorbed + prior.sigma_s**-2
        # the gradient of the factors is zero at their optimum
        gradient = (
            np.vdot(by_time_offset, weight * fit.difference).real
            + (time_offset_s - prior.time_offset_s) / prior.sigma_s**2
        )
        return -float(gradient / information), float(information**-0.5)

    def gain(self, time_offset_s: float, other_s: float) -> float:
        """Return twice the log-likelihood ratio of a time offset over another one."""
        if self.count == 0:
            return 0.0
        spread = self.spread(time_offset_s)
        return self.cost(other_s, spread) - self.cost(time_offset_s, spread)

    def cost(self, time_offset_s: float, spread: FloatArray) -> float:
        """Return twice the negative log-likelihood of a time offset, but for a constant.

        Args:
            time_offset_s: Time offset.
            spread: (n,) of the differences, per axis.
        """
        fit, width = self._fitted(time_offset_s), self.config.robust_spreads
        misfit = width**2 * np.log1p(np.abs(fit.difference / (width * spread)) ** 2).sum()
        apart = np.sum(np.abs(fit.factor - 1.0) ** 2) / self.config.factor_sigma**2
        return float(misfit + apart - self._shared * np.abs(np.sum(fit.factor - 1.0)) ** 2)

    def spread(self, time_offset_s: float) -> FloatArray:
        """Return the spread (n,) of the differences at a time offset, per axis."""
        return self._spread(self._fitted(time_offset_s).difference)

    def _camera_displacement(self, time_offset_s: FloatArray | float) -> ComplexArray:
        at = place(self._path.t_s, self._fixes.t_s - np.asarray(time_offset_s)[..., None], beyond=True)
        before, after = self._antenna[at.frame], self._antenna[at.frame + 1]
        return np.diff(before + at.alpha * (after - before))[..., self._rows]

    def _fitted(self, time_offset_s: FloatArray | float) -> "_Fitted":
        """Return the best factors for time offsets (...,) by reweighted least squares."""
        displacement = self._camera_displacement(time_offset_s)
        factor: ComplexArray = np.ones((*displacement.shape[:-1], self._knots.count), dtype=np.complex128)
        for _ in range(_REWEIGHTINGS):
            weight = self._weight(displacement * self._knots.interpolated(factor) - self._displacement)
            right = self._knots.sums(weight * displacement.conj() * self._displacement)
            factor = self._solved(displacement, weight, right + self._information_of_one)
        return _Fitted(
            displacement, factor, displacement * self._knots.interpolated(factor) - self._displacement
        )

    def _weight(self, difference: ComplexArray) -> FloatArray:
        """Return Cauchy's weight (..., n) divided by the variance."""
        spread = self._spread(difference)
        bend = self.config.robust_spreads * spread
        return np.asarray(1.0 / (1.0 + np.abs(difference / bend) ** 2) / spread**2)

    def _spread(self, difference: ComplexArray) -> FloatArray:
        """Return the spread (..., n) per axis of each pair's class of fixes, drawn towards that of all."""
        length, groups = np.abs(difference), self._rows_of_group
        if not self.count:
            return length
        whole = np.median(length, axis=-1)
        of_group = [np.median(length[..., rows], axis=-1) for rows in groups] if len(groups) > 1 else [whole]
        spread = np.maximum(np.stack([whole, *of_group], axis=-1), MIN_SPREAD_M * MEDIAN) / MEDIAN
        share = self._group_size / (self._group_size + _PAIRS_OF_ALL)
        drawn = spread[..., :1] * (spread[..., 1:] / spread[..., :1]) ** share
        return np.asarray(drawn[..., self._group])

    def _solved(self, displacement: ComplexArray, weight: FloatArray, right: ComplexArray) -> ComplexArray:
        """Return the solutions (..., K) of the factors' normal equations: real, and tridiagonal but for what
        the prior takes as common to all (Sherman & Morrison, 1950)."""
        band = self._band(displacement, weight)
        sides = np.stack([right.ravel(), np.ones(right.size)], axis=-1)
        solved = solveh_banded(band.reshape(2, -1), sides).reshape(*right.shape, 2)
        apart, common = solved[..., 0], solved[..., 1].real
        share = self._shared * apart.sum(axis=-1) / (1.0 - self._shared * common.sum(axis=-1))
        return np.asarray(apart + common * share[..., None], np.complex128)

    def _band(self, displacement: ComplexArray, weight: FloatArray) -> FloatArray:
        """Return the upper bands (2, ..., K) of the factors' normal matrices, with the part of the prior that
        is each factor's own."""
        band = self._knots.normal_band(weight * np.abs(displacement) ** 2)
        band[1] += self.config.factor_sigma**-2
        return band


class _Fitted(NamedTuple):
    """Displacements (..., n) of the camera, factors (..., K) at the knots, and differences from the fixes."""

    displacement: ComplexArray
    factor: ComplexArray
    difference: ComplexArray

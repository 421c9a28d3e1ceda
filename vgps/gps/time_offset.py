"""Estimation of the time offset between GPS and video from changes of speed and heading.

The error of a fix changes slowly, over a minute for an RTK-float, so the displacement between successive
fixes is far more accurate than their positions. Compared with the camera's displacement over the same time it
makes the time offset observable wherever speed or heading changes, but not on a straight at constant speed.
Scale and heading of visual odometry are wrong by a slowly changing factor, which would look like a time
offset while a vehicle keeps accelerating or turning. So the displacements are compared at the best such
factor for every time offset.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.linalg import solveh_banded
from scipy.special import ndtr, stdtrit

from vgps.config import SensorsConfig, TimeOffsetConfig
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.model import FloatArray, IntArray
from vgps.solution import Trajectory

_MIN_SPREAD_M = 0.005  # for differences that agree exactly, as simulated ones may
_ITERATIONS = 30  # upper limit; from the best value of the grid a few suffice
_DELTA_S = 0.01  # step of the difference quotient
_REWEIGHTINGS = 2  # within each step of the time offset

ComplexArray = npt.NDArray[np.complex128]


def update_time_offset(
    sensors: Sensors, path: Trajectory, fixes: Fixes, config: SensorsConfig
) -> tuple[Sensors, tuple[str, ...]]:
    """Decide whether the time offset is estimated with the poses, and set its prior; also return warnings.

    Args:
        sensors: Lever arm, and the time offset to update.
        path: The path so far.
        fixes: Fixes at the times of their time stamps, with their verdicts applied.
        config: Prior of the time offset, and limits of significance.
    """
    prior = TimeOffset(config.time_offset_s, config.time_offset_prior_s)
    if not prior.sigma_s:
        return sensors, ()
    pairs = neighbour_pairs(path, fixes, sensors.camera_p_antenna, prior, config.time_offset)
    best = best_time_offset(pairs, prior)
    change_s = abs(best.time_offset_s - prior.time_offset_s)
    observable = best.sigma_s < config.time_offset.shown_share * prior.sigma_s
    chance_s = config.significance_sigmas * float(np.hypot(config.trusted_time_offset_s, best.sigma_s))
    # the best value of a grid may be precise by chance: it must explain the fixes better than the prior
    tried = 1.0 + 2.0 * config.time_offset.search_sigmas * prior.sigma_s / best.sigma_s
    needed = min_gain(config.significance_sigmas, pairs.degrees_of_freedom, tried)
    significant = change_s > chance_s and pairs.gain(best.time_offset_s, prior.time_offset_s) > needed
    if observable and (config.estimate_time_offset == "yes" or significant):
        # the path was fitted before at another time offset, which may hide part of it: a wider prior
        sigma_s = float(np.hypot(best.sigma_s, config.trusted_time_offset_s))
        return sensors.with_time_offset(TimeOffset(best.time_offset_s, sigma_s)), (
            f"the GPS positions are {best.time_offset_s:.2f} s older than their time stamps; the fixes were "
            "shifted accordingly",
        )
    held = sensors.with_time_offset(TimeOffset(config.time_offset_s, 0.0))
    if observable or not fixes.used.any():
        return held, ()
    return held, (
        "the motion does not determine the time offset between video and GPS (standard deviation "
        f"{best.sigma_s:.2f} s); it was held at {config.time_offset_s:g} s: record turns or braking to "
        "estimate it",
    )


def min_gain(significance_sigmas: float, degrees_of_freedom: int, values: float) -> float:
    """Return the gain in log-likelihood, times two, above which the best of many values is significant.

    Student's t, since the spread is estimated from few pairs, with Bonferroni's correction for the number of
    values.

    Args:
        significance_sigmas: Significance as standard deviations of a single value of known spread.
        degrees_of_freedom: Degrees of freedom of the residuals that give the spread.
        values: Number of distinguishable values.
    """
    if degrees_of_freedom < 1:
        return float("inf")
    chance = float(ndtr(-significance_sigmas)) / values
    return float(stdtrit(degrees_of_freedom, chance)) ** 2


def neighbour_pairs(
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    prior: TimeOffset,
    config: TimeOffsetConfig,
) -> "NeighbourPairs":
    """Return the pairs of fixes that are within the video for every time offset searched.

    Args:
        path: In the world, at approximately the right scale.
        fixes: Fixes at the times of their time stamps; used ones are paired.
        camera_p_antenna: (3,) metres.
        prior: Prior of the time offset.
        config: Selection and comparison of pairs.
    """
    t_s, reach = fixes.t_s - prior.time_offset_s, config.search_sigmas * prior.sigma_s
    searched = fixes.where(fixes.used & (t_s > path.t_s[0] + reach) & (t_s < path.t_s[-1] - reach))
    equal = np.isclose(np.diff(searched.r_m), 0.0)
    rows = np.flatnonzero(equal & (np.diff(searched.t_s) <= config.max_pair_s))
    return NeighbourPairs(path, searched, camera_p_antenna, rows, config)


def best_time_offset(pairs: "NeighbourPairs", prior: TimeOffset) -> TimeOffset:
    """Return the time offset at which the displacements of the fixes agree best with the camera's.

    Minimises a Cauchy loss of the differences relative to their spread, plus the prior, from the best value
    of a grid.
    """
    if pairs.count < 3:
        return prior
    reach, step_s = pairs.config.search_sigmas * prior.sigma_s, pairs.config.search_step_s
    grid = prior.time_offset_s + np.arange(-reach, reach + step_s, step_s)
    time_offset_s = float(
        grid[int(np.argmin([np.median(pairs.difference(value)) for value in grid.tolist()]))]
    )
    for _ in range(_ITERATIONS):
        step, sigma_s = pairs.step(time_offset_s, prior)
        time_offset_s += step
        if abs(step) < 1e-5:
            break
    return TimeOffset(time_offset_s, sigma_s)


class NeighbourPairs:
    """Pairs of successive fixes; ``rows`` (n,) are the first of each.

    Horizontal displacements are complex numbers, so that a complex factor rotates and scales them.
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
        self._path, self._fixes, self._antenna, self._rows = path, fixes, camera_p_antenna, rows
        t_s = path.t_s
        self._displacement = _displacements(fixes.world_p_fix)[self._rows]
        knots = np.linspace(t_s[0], t_s[-1], 2 + int(np.ptp(t_s) / config.knot_s))
        self._knot_weight = knot_weights(fixes.t_s[self._rows], knots)

    @property
    def count(self) -> int:
        """Number of pairs."""
        return len(self._rows)

    @property
    def degrees_of_freedom(self) -> int:
        """Number of residuals minus that of the factors' parameters and the time offset."""
        return 2 * self.count - 2 * int(self._knot_weight.shape[1]) - 1

    @property
    def interval_s(self) -> FloatArray:
        """(n,) times from one fix of a pair to the other."""
        return np.asarray(np.diff(self._fixes.t_s)[self._rows])

    @property
    def length_m(self) -> FloatArray:
        """(n,) distances of the antenna from one fix of a pair to the other, as the camera sees them."""
        return np.abs(self._camera_displacement(0.0))

    def difference(self, time_offset_s: float) -> FloatArray:
        """Return the lengths (n,) of the differences, metres."""
        return np.abs(self._fitted(time_offset_s).difference)

    def step(self, time_offset_s: float, prior: TimeOffset) -> tuple[float, float]:
        """Return the Gauss-Newton step of the reweighted problem, and the marginal standard deviation."""
        fit = self._fitted(time_offset_s)
        by_time_offset = (
            (self._camera_displacement(time_offset_s + _DELTA_S) - fit.displacement)
            / _DELTA_S
            * self._at_pairs(fit.factor)
        )
        weight = _weight(fit.difference, self.config.robust_spreads)
        shared = self._by_knot(weight * fit.displacement.conj() * by_time_offset)
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
        ends = self._fitted(time_offset_s), self._fitted(other_s)
        width = self.config.robust_spreads
        bend = width * _spread(ends[0].difference)
        cost = [
            width**2 * np.log1p(np.abs(end.difference / bend) ** 2).sum()
            + (np.abs(end.factor - 1.0) ** 2).sum() / self.config.factor_sigma**2
            for end in ends
        ]
        return float(cost[1] - cost[0])

    def _camera_displacement(self, time_offset_s: float) -> ComplexArray:
        placement = place(self._path.t_s, self._fixes.t_s - time_offset_s, beyond=True)
        return _displacements(antenna_at(self._path.world_T_camera, placement, self._antenna))[self._rows]

    def _fitted(self, time_offset_s: float) -> "_Fitted":
        """Return the best factors for a time offset by reweighted least squares."""
        displacement = self._camera_displacement(time_offset_s)
        factor: ComplexArray = np.ones(self._knot_weight.shape[1], dtype=np.complex128)
        for _ in range(_REWEIGHTINGS):
            weight = _weight(
                displacement * self._at_pairs(factor) - self._displacement, self.config.robust_spreads
            )
            right = self._by_knot(weight * displacement.conj() * self._displacement)
            factor = self._solved(displacement, weight, right + self.config.factor_sigma**-2)
        return _Fitted(displacement, factor, displacement * self._at_pairs(factor) - self._displacement)

    def _at_pairs(self, factor: ComplexArray) -> ComplexArray:
        """Return the factors (n,) at the pairs from those (K,) at the knots."""
        return np.asarray(self._knot_weight @ factor)

    def _by_knot(self, values: ComplexArray) -> ComplexArray:
        """Return the sums (K,) of values (n,) with the weights of the knots."""
        return np.asarray(self._knot_weight.T @ values)

    def _solved(self, displacement: ComplexArray, weight: FloatArray, right: ComplexArray) -> ComplexArray:
        """Return the solution (K,) of the factors' normal equations, which are tridiagonal and real."""
        squared = self._knot_weight.T @ sparse.diags_array(weight * np.abs(displacement) ** 2)
        hessian = squared @ self._knot_weight
        band = np.zeros((2, hessian.shape[0]))
        band[0, 1:] = hessian.diagonal(1)
        band[1] = hessian.diagonal() + self.config.factor_sigma**-2
        return np.asarray(solveh_banded(band, right), np.complex128)


def knot_weights(at_s: FloatArray, knots_s: FloatArray) -> sparse.csr_array:
    """Return the weights (n, K) of knots at some times, those of linear interpolation."""
    at = place(knots_s, at_s)
    entries = np.concatenate([1.0 - at.alpha, at.alpha])
    index = (np.tile(np.arange(len(at_s)), 2), np.concatenate([at.frame, at.frame + 1]))
    return sparse.csr_array((entries, index), shape=(len(at_s), len(knots_s)))


class _Fitted(NamedTuple):
    """Displacements (n,) of the camera, factors (K,) at the knots, and differences (n,) from the fixes."""

    displacement: ComplexArray
    factor: ComplexArray
    difference: ComplexArray


def _displacements(points: FloatArray) -> ComplexArray:
    """Return displacements (n - 1,) from one point to the next, east + i north."""
    return np.diff(points[:, 0] + 1j * points[:, 1])


def _weight(difference: ComplexArray, width: float) -> FloatArray:
    """Return Cauchy's weight divided by the variance."""
    spread = _spread(difference)
    return np.asarray(1.0 / (1.0 + np.abs(difference / (width * spread)) ** 2) / spread**2)


def _spread(difference: ComplexArray) -> float:
    """Return the spread per axis; the median length of a Gaussian vector in the plane is 1.18 times that."""
    return max(float(np.median(np.abs(difference))) / 1.1774, _MIN_SPREAD_M)

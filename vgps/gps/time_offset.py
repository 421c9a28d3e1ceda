"""The time offset of the GPS's clock behind the video, from speed and turn rate.

The error of a fix wanders slowly, over a minute for an RTK-float, so the displacement from one fix to the
next is far better known than their positions. Compared with the camera's displacement over the same second,
it shows the time offset wherever speed or heading change, and shows nothing on a straight at constant speed.
A camera's scale and heading are wrong by a factor that changes slowly, which would pass for a time offset
wherever a vehicle keeps accelerating or turning: so at every offset the displacements are compared at the
best such factor.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, stdtrit

from vgps.config import SensorsConfig, TimeOffsetConfig
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.model import FloatArray
from vgps.solution import Trajectory

_MIN_SPREAD_M = 0.005  # of differences that agree exactly, as simulated ones may
_ITERATIONS = 30  # a guard: from the best of the grid a handful suffices
_DELTA_S = 0.01  # of the difference quotient
_REWEIGHTED = 2  # times, within each step of the time offset

ComplexArray = npt.NDArray[np.complex128]


def update_time_offset(
    sensors: Sensors, path: Trajectory, fixes: Fixes, config: SensorsConfig
) -> tuple[Sensors, tuple[str, ...]]:
    """Return whether a time offset is to be estimated with the poses, and from which value; with remarks.

    Args:
        sensors: The lever arm.
        path: As it is so far.
        fixes: By their own clock, as they are assessed.
        config: The prior, and what is significant.
    """
    believed = TimeOffset(config.time_offset_s, config.time_offset_prior_s)
    if not believed.sigma_s:
        return sensors, ()
    pairs = neighbour_pairs(path, fixes, sensors.camera_p_antenna, believed, config.time_offset)
    found = best_time_offset(pairs, believed)
    change_s = abs(found.time_offset_s - believed.time_offset_s)
    shown = found.sigma_s < config.time_offset.shown_share * believed.sigma_s
    chance_s = config.significance_sigmas * float(np.hypot(config.trusted_time_offset_s, found.sigma_s))
    # the best of a grid is narrow by chance too: it must explain the fixes better than the prior does
    tried = 1.0 + 2.0 * config.time_offset.search_sigmas * believed.sigma_s / found.sigma_s
    needed = least_gain(config.significance_sigmas, pairs.freedom, tried)
    real = change_s > chance_s and pairs.gain(found.time_offset_s, believed.time_offset_s) > needed
    if shown and (config.estimate_time_offset == "yes" or real):
        # the path was fitted to the fixes before, at another offset, and may hide as much
        doubtful = TimeOffset(
            found.time_offset_s, float(np.hypot(found.sigma_s, config.trusted_time_offset_s))
        )
        return sensors.with_time_offset(doubtful), (
            f"the positions of the GPS log are {found.time_offset_s:.2f} s older than their time stamps say; "
            "this was corrected",
        )
    held = sensors.with_time_offset(TimeOffset(config.time_offset_s, 0.0))
    if shown or not fixes.used.any():
        return held, ()
    return held, (
        "the motion does not show the time offset between video and GPS (standard deviation "
        f"{found.sigma_s:.2f} s): it was held at {config.time_offset_s:g} s; turns or braking would show it",
    )


def least_gain(significant: float, freedom: int, tried: float) -> float:
    """Return what the best of many values must gain to be as rare by chance as so many standard deviations.

    Student's t, as few pairs may agree by chance, over the number of values tried (Bonferroni).

    Args:
        significant: Standard deviations, for one value and a known spread.
        freedom: Degrees of freedom of the residuals that give the spread.
        tried: How many distinguishable values there are.
    """
    if freedom < 1:
        return float("inf")
    chance = float(ndtr(-significant)) / tried
    return float(stdtrit(freedom, chance)) ** 2


def neighbour_pairs(
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    believed: TimeOffset,
    config: TimeOffsetConfig,
) -> "NeighbourPairs":
    """Return the pairs of fixes that stay within the video whatever the time offset is.

    Args:
        path: In the world, its scale about right.
        fixes: By their own clock; those used take part.
        camera_p_antenna: (3,) metres.
        believed: The prior.
        config: Which pairs, and how they are compared.
    """
    taken_s, reach = fixes.t_s - believed.time_offset_s, config.search_sigmas * believed.sigma_s
    inside = fixes.used & (taken_s > path.t_s[0] + reach) & (taken_s < path.t_s[-1] - reach)
    return NeighbourPairs(path, fixes.where(inside), camera_p_antenna, config)


def best_time_offset(pairs: "NeighbourPairs", believed: TimeOffset) -> TimeOffset:
    """Return the time offset at which the displacements of the fixes agree best with the camera's.

    Minimises a Cauchy loss of the differences, in units of their own spread, and of the distance from the
    prior; from the best of a grid.
    """
    if pairs.count < 3:
        return believed
    reach, step_s = pairs.config.search_sigmas * believed.sigma_s, pairs.config.search_step_s
    grid = believed.time_offset_s + np.arange(-reach, reach + step_s, step_s)
    time_offset_s = float(grid[int(np.argmin([np.median(pairs.difference(lag)) for lag in grid.tolist()]))])
    for _ in range(_ITERATIONS):
        step, sigma_s = pairs.step(time_offset_s, believed)
        time_offset_s += step
        if abs(step) < 1e-5:
            break
    return TimeOffset(time_offset_s, sigma_s)


class NeighbourPairs:
    """Neighbouring fixes of like accuracy.

    Displacements in the plane are complex numbers, so that a factor rotates and scales them.
    """

    def __init__(
        self, path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: TimeOffsetConfig
    ) -> None:
        self.config = config
        self._path, self._fixes, self._antenna = path, fixes, camera_p_antenna
        t_s = path.t_s
        alike = np.isclose(np.diff(fixes.r_m), 0.0)
        self._rows = np.flatnonzero(alike & (np.diff(fixes.t_s) <= config.max_pair_s))
        self._displacement = _displacements(fixes.world_p_fix)[self._rows]
        knots = np.linspace(t_s[0], t_s[-1], 2 + int(np.ptp(t_s) / config.knot_s))
        at_s = fixes.t_s[self._rows]
        # (n, K) how much each knot counts for each pair
        self._share = np.stack([np.interp(at_s, knots, row) for row in np.eye(len(knots))], axis=1)

    @property
    def count(self) -> int:
        """Number of pairs."""
        return len(self._rows)

    @property
    def freedom(self) -> int:
        """Degrees of freedom: residuals beyond the factors and the time offset."""
        return 2 * self.count - 2 * int(self._share.shape[1]) - 1

    def difference(self, time_offset_s: float) -> FloatArray:
        """Return the lengths (n,) of the differences, metres."""
        return np.abs(self._fitted(time_offset_s).difference)

    def step(self, time_offset_s: float, believed: TimeOffset) -> tuple[float, float]:
        """Return the Gauss-Newton step of the reweighted problem, and the standard deviation, factors
        free."""
        found = self._fitted(time_offset_s)
        by_time_offset = (
            (self._camera_displacement(time_offset_s + _DELTA_S) - found.displacement)
            / _DELTA_S
            * (self._share @ found.factor)
        )
        weight = _weight(found.difference, self.config.robust_spreads)
        hessian, A = self._normal(found.displacement, weight)
        shared = A.conj().T @ (weight * by_time_offset)
        known = np.vdot(shared, np.linalg.solve(hessian, shared)).real  # what the factors could explain too
        information = np.sum(weight * np.abs(by_time_offset) ** 2) - known + believed.sigma_s**-2
        # the factors are at their best, so they do not pull
        gradient = (
            np.vdot(by_time_offset, weight * found.difference).real
            + (time_offset_s - believed.time_offset_s) / believed.sigma_s**2
        )
        return -float(gradient / information), float(information**-0.5)

    def gain(self, time_offset_s: float, other_s: float) -> float:
        """Return twice the log of how much more likely a time offset is than another one."""
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
        """Return the best factors for a time offset: least squares, reweighted."""
        displacement = self._camera_displacement(time_offset_s)
        factor: ComplexArray = np.ones(self._share.shape[1], dtype=np.complex128)
        for _ in range(_REWEIGHTED):
            weight = _weight(
                displacement * (self._share @ factor) - self._displacement, self.config.robust_spreads
            )
            hessian, A = self._normal(displacement, weight)
            pull = A.conj().T @ (weight * self._displacement) + self.config.factor_sigma**-2
            factor = np.asarray(np.linalg.solve(hessian, pull), np.complex128)
        return _Fitted(displacement, factor, displacement * (self._share @ factor) - self._displacement)

    def _normal(self, displacement: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the Hessian (K, K) of the factors, and the displacements' derivatives by them (n, K)."""
        A = self._share * displacement[:, None]
        return A.conj().T @ (weight[:, None] * A) + np.eye(A.shape[1]) / self.config.factor_sigma**2, A


class _Fitted(NamedTuple):
    """The camera's displacements (n,), the factors at the knots (K,), and the differences to the fixes'
    (n,)."""

    displacement: ComplexArray
    factor: ComplexArray
    difference: ComplexArray


def _displacements(points: FloatArray) -> ComplexArray:
    """Return displacements (n - 1,) from one point to the next, east + i north."""
    return np.diff(points[:, 0] + 1j * points[:, 1])


def _weight(difference: ComplexArray, width: float) -> FloatArray:
    """Return Cauchy's weight over the variance."""
    spread = _spread(difference)
    return np.asarray(1.0 / (1.0 + np.abs(difference / (width * spread)) ** 2) / spread**2)


def _spread(difference: ComplexArray) -> float:
    """Return the spread per axis: the median length of a Gaussian in the plane is 1.18 times that."""
    return max(float(np.median(np.abs(difference))) / 1.1774, _MIN_SPREAD_M)

"""The lag of the GPS's clock behind the video, from speed and turn rate.

The error of a fix wanders slowly, over a minute for an RTK-float, so what changes between one fix and the
next is far better known than where they are. Compared with the way of the camera over the same second, it
shows the lag wherever speed or heading change, and shows nothing on a straight at constant speed. A camera's
scale and heading are off by a share that changes slowly, which would pass for a lag wherever a vehicle goes
on speeding up or turning: so at every lag the ways are compared at the best such share.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, stdtrit

from vgps.config import SensorsConfig
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.model import FloatArray
from vgps.solution import Trajectory

_SEEN = 0.5  # of the prior standard deviation: what is larger was not seen
_LONGEST_S = 3.0  # between two fixes that are compared
_REACH = 3.0  # prior standard deviations that are searched
_STEP_S = 0.05  # of the coarse search, a fraction of what a vehicle needs to turn
_LEAST_M = 0.005
_KNOT_S = 20.0  # from one to the next the camera's scale and heading change at most evenly
_SLOW = 0.05  # standard deviation of their error, as a share and in radians
_WIDTH = 2.0  # Cauchy's loss bends at so many spreads
_ITERATIONS = 30
_DELTA_S = 0.01
_REWEIGHTED = 2

ComplexArray = npt.NDArray[np.complex128]


def update_time_offset(
    sensors: Sensors, path: Trajectory, fixes: Fixes, config: SensorsConfig
) -> tuple[Sensors, tuple[str, ...]]:
    """Whether there is a lag to be estimated with the poses, from what it looks like on; a remark on it.

    Args:
        sensors: The lever arm.
        path: As it is so far.
        fixes: By their own clock, as they are judged.
        config: What is believed, and what is significant.
    """
    believed = TimeOffset(config.time_offset_s, config.time_offset_prior_s)
    if not believed.sigma_s:
        return sensors, ()
    pairs = _pairs(path, fixes, sensors.camera_p_antenna, believed)
    found = _best_time_offset(pairs, believed)
    change_s, seen = (
        abs(found.time_offset_s - believed.time_offset_s),
        found.sigma_s < _SEEN * believed.sigma_s,
    )
    chance_s = config.significance_sigmas * float(np.hypot(config.trusted_time_offset_s, found.sigma_s))
    # the best of a grid is narrow by chance too: it must explain the fixes better than what was believed
    tried = 1.0 + 2.0 * _REACH * believed.sigma_s / found.sigma_s
    needed = least_gain(config.significance_sigmas, pairs.freedom, tried)
    real = change_s > chance_s and pairs.gain(found.time_offset_s, believed.time_offset_s) > needed
    if seen and (config.estimate_time_offset == "yes" or real):
        # the path was fitted to the fixes before, at another lag: it may hide as much
        doubtful = TimeOffset(
            found.time_offset_s, float(np.hypot(found.sigma_s, config.trusted_time_offset_s))
        )
        return sensors.with_time_offset(doubtful), (
            f"the positions of the GPS log are {found.time_offset_s:.2f} s older than their time stamps say; "
            "this was corrected",
        )
    held = sensors.with_time_offset(TimeOffset(config.time_offset_s, 0.0))
    if seen or config.estimate_time_offset == "auto":
        return held, ()
    return held, (
        "the motion does not show the lag between the clocks of video and GPS (standard deviation "
        f"{found.sigma_s:.2f} s): it was held at {config.time_offset_s:g} s; curves or braking would show it",
    )


def time_offset_by_differences(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, believed: TimeOffset
) -> TimeOffset:
    """Time offset at which the horizontal ways from fix to fix agree with the camera's.

    Minimises a Cauchy loss of the differences' disagreement, in units of its own spread, and of the lag's
    distance from what is believed; from the best of a grid.

    Args:
        path: In the world, its scale about right.
        fixes: By their own clock; those used take part.
        camera_p_antenna: (3,) metres.
        believed: Before anything was seen.
    """
    return _best_time_offset(_pairs(path, fixes, camera_p_antenna, believed), believed)


def least_gain(significant: float, freedom: int, tried: float) -> float:
    """What the best of many values must gain to be as rare by chance as so many standard deviations.

    Student's t, as few pairs may agree by chance, over the number of values tried (Bonferroni).

    Args:
        significant: Standard deviations, for one value and a known spread.
        freedom: Of the residuals that the spread is told from.
        tried: How many values there are that do not agree with each other.
    """
    if freedom < 1:
        return float("inf")
    chance = float(ndtr(-significant)) / tried
    return float(stdtrit(freedom, chance)) ** 2


def _pairs(path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, believed: TimeOffset) -> "_Pairs":
    """Of the fixes that stay within the video whatever the lag may be."""
    taken_s, reach = fixes.t_s - believed.time_offset_s, _REACH * believed.sigma_s
    inside = fixes.used & (taken_s > path.t_s[0] + reach) & (taken_s < path.t_s[-1] - reach)
    return _Pairs(path, fixes.where(inside), camera_p_antenna)


def _best_time_offset(pairs: "_Pairs", believed: TimeOffset) -> TimeOffset:
    """The best of a grid, refined."""
    if pairs.count < 3:
        return believed
    reach = _REACH * believed.sigma_s
    grid = believed.time_offset_s + np.arange(-reach, reach + _STEP_S, _STEP_S)
    time_offset_s = float(grid[int(np.argmin([np.median(pairs.apart(lag)) for lag in grid.tolist()]))])
    for _ in range(_ITERATIONS):
        step, sigma_s = pairs.step(time_offset_s, believed)
        time_offset_s += step
        if abs(step) < 1e-5:
            break
    return TimeOffset(time_offset_s, sigma_s)


class _Pairs:
    """Neighbouring fixes of like accuracy; ways in the plane as complex numbers, so that a factor turns and
    scales them."""

    def __init__(self, path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray) -> None:
        self._path, self._fixes, self._antenna = path, fixes, camera_p_antenna
        t_s = path.t_s
        alike = np.isclose(np.diff(fixes.r_m), 0.0)
        self._rows = np.flatnonzero(alike & (np.diff(fixes.t_s) <= _LONGEST_S))
        self._way = _ways(fixes.world_p_fix)[self._rows]
        knots = np.linspace(t_s[0], t_s[-1], 2 + int(np.ptp(t_s) / _KNOT_S))
        at_s = fixes.t_s[self._rows]
        # (n, K) how much each knot counts for each pair
        self._share = np.stack([np.interp(at_s, knots, row) for row in np.eye(len(knots))], axis=1)

    @property
    def count(self) -> int:
        """How many."""
        return len(self._rows)

    @property
    def freedom(self) -> int:
        """Residuals beyond the factors and the lag."""
        return 2 * self.count - 2 * int(self._share.shape[1]) - 1

    def apart(self, time_offset_s: float) -> FloatArray:
        """(n,) lengths of the disagreements, metres."""
        return np.abs(self._fitted(time_offset_s).apart)

    def step(self, time_offset_s: float, believed: TimeOffset) -> tuple[float, float]:
        """Gauss-Newton step of the reweighted problem, and the standard deviation there, factors free."""
        found = self._fitted(time_offset_s)
        by_time_offset = (
            (self._camera_way(time_offset_s + _DELTA_S) - found.way) / _DELTA_S * (self._share @ found.factor)
        )
        weight = _weight(found.apart)
        hessian, A = self._normal(found.way, weight)
        shared = A.conj().T @ (weight * by_time_offset)
        known = np.vdot(shared, np.linalg.solve(hessian, shared)).real  # what the factors could explain too
        information = np.sum(weight * np.abs(by_time_offset) ** 2) - known + believed.sigma_s**-2
        # the factors are at their best, so they do not pull
        gradient = (
            np.vdot(by_time_offset, weight * found.apart).real
            + (time_offset_s - believed.time_offset_s) / believed.sigma_s**2
        )
        return -float(gradient / information), float(information**-0.5)

    def gain(self, time_offset_s: float, other_s: float) -> float:
        """Twice the log of how much more likely a lag is than another one."""
        if self.count == 0:
            return 0.0
        ends = self._fitted(time_offset_s), self._fitted(other_s)
        bend = _WIDTH * _spread(ends[0].apart)
        cost = [
            _WIDTH**2 * np.log1p(np.abs(end.apart / bend) ** 2).sum()
            + (np.abs(end.factor - 1.0) ** 2).sum() / _SLOW**2
            for end in ends
        ]
        return float(cost[1] - cost[0])

    def _camera_way(self, time_offset_s: float) -> ComplexArray:
        placement = place(self._path.t_s, self._fixes.t_s - time_offset_s, beyond=True)
        return _ways(antenna_at(self._path.world_T_camera, placement, self._antenna))[self._rows]

    def _fitted(self, time_offset_s: float) -> "_Fitted":
        """At the best factors for a lag: least squares, reweighted."""
        way = self._camera_way(time_offset_s)
        factor: ComplexArray = np.ones(self._share.shape[1], dtype=np.complex128)
        for _ in range(_REWEIGHTED):
            weight = _weight(way * (self._share @ factor) - self._way)
            hessian, A = self._normal(way, weight)
            pull = A.conj().T @ (weight * self._way) + _SLOW**-2
            factor = np.asarray(np.linalg.solve(hessian, pull), np.complex128)
        return _Fitted(way, factor, way * (self._share @ factor) - self._way)

    def _normal(self, way: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """(K, K) of the factors, and (n, K) the ways' derivatives to them."""
        A = self._share * way[:, None]
        return A.conj().T @ (weight[:, None] * A) + np.eye(A.shape[1]) / _SLOW**2, A


class _Fitted(NamedTuple):
    """The camera's ways (n,), the factors at the knots (K,), and what is left between them and the fixes."""

    way: ComplexArray
    factor: ComplexArray
    apart: ComplexArray


def _ways(points: FloatArray) -> ComplexArray:
    """(n - 1,) from one to the next, east + i north."""
    return np.diff(points[:, 0] + 1j * points[:, 1])


def _weight(apart: ComplexArray) -> FloatArray:
    """Cauchy's, over the variance."""
    spread = _spread(apart)
    return np.asarray(1.0 / (1.0 + np.abs(apart / (_WIDTH * spread)) ** 2) / spread**2)


def _spread(apart: ComplexArray) -> float:
    """On an axis: the median length of a Gaussian in the plane is 1.18 of it."""
    return max(float(np.median(np.abs(apart))) / 1.1774, _LEAST_M)

"""Clocks of GPS and video that run at different rates, found by the displacements between fixes.

Whoever takes a video of 29.97 frames a second for one of 30 has clocks that differ by a thousandth: fixes are
where the camera was a little earlier or later, the more so the longer the video. As for the time offset
(:mod:`vgps.gps.time_offset`), displacements between fixes are compared with the camera's over the same time,
which show the rate where the path turns or brakes both early and late in the video.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from vgps.config import SensorsConfig
from vgps.gps.fixes import Fixes
from vgps.gps.jackknife import BLOCKS, MIN_PAIRS, jackknife_sigma, without_blocks
from vgps.gps.neighbour_pairs import MEDIAN, MIN_SPREAD_M, NeighbourPairs, neighbour_pairs
from vgps.gps.sensors import TimeOffset
from vgps.gps.time_offset import best_time_offset, compared_fixes, min_gain
from vgps.model import FloatArray
from vgps.solution import GpsClock, Trajectory

_MAX_RATE = 0.05  # 9.66 frames a second taken for 10 are 0.034
_MAX_SHIFT_S = 15.0  # of the first and the last fix
_STEP_S = 0.1  # of that shift: a fraction of the time that a turn takes
_LEAST_SIGMAS = 2.0  # of the jackknife: on an orbit at constant speed the parts of the video do not agree


def parts_agree(rate: float, rate_sigma: float) -> bool:
    """Return whether the parts of a video agree on a rate: by two standard deviations of their jackknife."""
    return abs(rate) > _LEAST_SIGMAS * rate_sigma


class ShownClock(NamedTuple):
    """A clock that the motion shows.

    Attributes:
        clock: Its time offset at the first frame, and its rate.
        time_offset_sigma_s: Standard deviation of its time offset in the middle of the video.
        rate_sigma: Standard deviation of its rate.
        is_significant: Whether a clock of the video's rate explains the fixes less well, beyond doubt.
    """

    clock: GpsClock
    time_offset_sigma_s: float
    rate_sigma: float
    is_significant: bool


def search_clock_rate(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig, anyway: bool = False
) -> ShownClock | None:
    """Return the clock that the motion shows; None if its rate may be that of the video.

    Standard deviations are those of a jackknife that leaves out one part of the video after the other: the
    video's scale and heading drift for longer than from one pair of fixes to the next.

    Args:
        path: Of the video alone, in the world, at approximately the right scale.
        fixes: Fixes at the times of their time stamps; used ones count.
        camera_p_antenna: (3,) metres.
        config: Time offset, how far about it others are searched, and how sure a rate must be.
        anyway: Whether a clock counts that is not significant.
    """
    compared = compared_fixes(fixes)
    rates = _Rates(path, camera_p_antenna, config)
    found = rates.likeliest(compared)
    if found is None or not (found.is_significant or anyway):
        return None
    parts = without_blocks(compared, int(np.ptp(path.t_s) / config.time_offset.knot_s))
    others = [other.clock for part in parts if (other := rates.likeliest(part)) is not None]
    if len(others) < BLOCKS[0]:
        return None
    rate = np.array([other.rate for other in others])
    offset_s = np.array([other.time_offset_s for other in others]) + rate * rates.middle_s
    sigma_s, rate_sigma = jackknife_sigma(offset_s), jackknife_sigma(rate)
    return found._replace(time_offset_sigma_s=sigma_s, rate_sigma=rate_sigma)


class _Rates:
    """Clocks of all rates, each at its best time offset in the middle of a path."""

    def __init__(self, path: Trajectory, camera_p_antenna: FloatArray, config: SensorsConfig) -> None:
        self._path, self._antenna, self._config = path, camera_p_antenna, config
        self._prior = TimeOffset.from_config(config)
        self._half_s = 0.5 * float(np.ptp(path.t_s))
        self._shift_s = min(_MAX_SHIFT_S, _MAX_RATE * self._half_s)
        self.middle_s = float(path.t_s[0]) + self._half_s

    def likeliest(self, fixes: Fixes) -> ShownClock | None:
        """Return the clock that explains fixes best, without standard deviations; None if they are few."""
        pairs = self._pairs(fixes)
        if pairs.count < MIN_PAIRS:
            return None
        step = _STEP_S / self._half_s
        near = self._on_grid(pairs, step)
        spread = self._at(pairs, near).spread(self._time_offset(pairs, near).time_offset_s)

        def cost(rate: float) -> float:
            offset_s = self._time_offset(pairs, rate).time_offset_s
            return self._at(pairs, rate).cost(offset_s, spread)

        best = minimize_scalar(cost, bounds=(near - step, near + step), method="bounded")
        rate = float(best.x)
        offset = self._time_offset(pairs, rate)
        tried = 1.0 + 2.0 * self._shift_s / offset.sigma_s
        needed = min_gain(self._config.significance_sigmas, pairs.degrees_of_freedom - 1, tried)
        clock = GpsClock(offset.time_offset_s - rate * self.middle_s, rate)
        return ShownClock(clock, np.nan, np.nan, cost(0.0) - float(best.fun) > needed)

    def _pairs(self, fixes: Fixes) -> NeighbourPairs:
        """Return the pairs of fixes that are within the video by every clock."""
        t_s, path_s = fixes.t_s - self._prior.time_offset_s, self._path.t_s
        reach_s = self._config.time_offset_reach_s + self._shift_s
        inside = fixes.where((t_s > path_s[0] + reach_s) & (t_s < path_s[-1] - reach_s))
        return neighbour_pairs(self._path, inside, self._antenna, self._prior, self._config.time_offset)

    def _on_grid(self, pairs: NeighbourPairs, step: float) -> float:
        """Return the likeliest rate of a grid, each at the best of a grid of time offsets."""
        rates = np.arange(-self._shift_s / self._half_s, self._shift_s / self._half_s + step / 2.0, step)
        reach_s = self._config.time_offset_reach_s
        offsets_s = self._prior.time_offset_s + np.arange(-reach_s, reach_s + _STEP_S / 2.0, _STEP_S)
        lengths = np.array([self._at(pairs, rate).difference(offsets_s) for rate in rates.tolist()])
        spread = max(float(np.median(lengths, axis=-1).min()) / MEDIAN, MIN_SPREAD_M)
        bend = pairs.config.robust_spreads * spread
        misfit = np.log1p((lengths / bend) ** 2).sum(axis=-1).min(axis=-1)
        return float(rates[int(np.argmin(misfit))])

    def _time_offset(self, pairs: NeighbourPairs, rate: float) -> TimeOffset:
        return best_time_offset(self._at(pairs, rate), self._prior)

    def _at(self, pairs: NeighbourPairs, rate: float) -> NeighbourPairs:
        times_s = pairs.fix_times_s
        return pairs.at_times(times_s - rate * (times_s - self.middle_s))

"""The lag of the GPS's clock behind the video, from speed and turn rate.

The error of a fix wanders slowly, over a minute for an RTK-float, so what changes between one fix and the
next is far better known than where they are. Compared with the way of the camera over the same second, it
shows the lag wherever speed or heading change, and shows nothing on a straight at constant speed.
"""

import numpy as np

from vgps.config import SensorsConfig
from vgps.model import FloatArray
from vgps.smoothing.fixes import Fixes, antenna_at, place
from vgps.smoothing.sensors import Lag, Sensors

_SEEN = 0.5  # of the prior standard deviation: what is larger was not seen
_LONGEST_S = 3.0  # between two fixes that are compared
_REACH = 3.0  # prior standard deviations that are searched
_STEP_S = 0.05  # of the coarse search, a fraction of what a vehicle needs to turn
_LEAST_M = 0.005
_WIDTH = 2.0  # Cauchy's loss bends at so many spreads
_ITERATIONS = 30
_DELTA_S = 0.01


def settle_lag(
    sensors: Sensors, poses: FloatArray, t_s: FloatArray, fixes: Fixes, config: SensorsConfig
) -> tuple[Sensors, tuple[str, ...]]:
    """Whether there is a lag to be estimated with the poses, from what it looks like on; a remark on it.

    Args:
        sensors: The lever arm.
        poses: (F, 4, 4), the path as it is so far.
        t_s: (F,).
        fixes: By their own clock, as they are judged.
        config: What is believed, and what is significant.
    """
    believed = Lag(config.lag_s, config.lag_prior_s)
    if not believed.sigma_s:
        return sensors, ()
    pairs = _pairs(poses, t_s, fixes, sensors.camera_p_antenna, believed)
    found = _best_lag(pairs, believed)
    change_s, seen = abs(found.lag_s - believed.lag_s), found.sigma_s < _SEEN * believed.sigma_s
    chance_s = config.significant * float(np.hypot(config.trusted_lag_s, found.sigma_s))
    # the best of a grid is narrow by chance too: it must explain the fixes better than what was believed
    real = change_s > chance_s and pairs.gain(found.lag_s, believed.lag_s) > config.significant**2
    if seen and (config.estimate_lag == "yes" or real):
        return sensors.with_lag(found), (
            f"the positions of the GPS log are {found.lag_s:.2f} s older than their time stamps say; "
            "this was corrected",
        )
    held = sensors.with_lag(Lag(config.lag_s, 0.0))
    if seen or config.estimate_lag == "auto":
        return held, ()
    return held, (
        "the motion does not show the lag between the clocks of video and GPS (standard deviation "
        f"{found.sigma_s:.2f} s): it was held at {config.lag_s:g} s; curves or braking would show it",
    )


def lag_by_differences(
    poses: FloatArray,
    t_s: FloatArray,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    believed: Lag,
) -> Lag:
    """Lag at which the horizontal ways from fix to fix agree with the camera's.

    Minimises a Cauchy loss of the differences' disagreement, in units of its own spread, and of the lag's
    distance from what is believed; from the best of a grid.

    Args:
        poses: (F, 4, 4), the path in the world, its scale about right.
        t_s: (F,).
        fixes: By their own clock; those used take part.
        camera_p_antenna: (3,) metres.
        believed: Before anything was seen.
    """
    return _best_lag(_pairs(poses, t_s, fixes, camera_p_antenna, believed), believed)


def _pairs(
    poses: FloatArray, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, believed: Lag
) -> "_Pairs":
    """Of the fixes that stay within the video whatever the lag may be."""
    taken_s, reach = fixes.t_s - believed.lag_s, _REACH * believed.sigma_s
    inside = fixes.used & (taken_s > t_s[0] + reach) & (taken_s < t_s[-1] - reach)
    return _Pairs(poses, t_s, fixes.where(inside), camera_p_antenna)


def _best_lag(pairs: "_Pairs", believed: Lag) -> Lag:
    """The best of a grid, refined."""
    if pairs.count < 3:
        return believed
    reach = _REACH * believed.sigma_s
    grid = believed.lag_s + np.arange(-reach, reach + _STEP_S, _STEP_S)
    lag_s = float(grid[int(np.argmin([np.median(pairs.apart(lag)) for lag in grid.tolist()]))])
    for _ in range(_ITERATIONS):
        step, sigma_s = pairs.step(lag_s, believed)
        lag_s += step
        if abs(step) < 1e-5:
            break
    return Lag(lag_s, sigma_s)


class _Pairs:
    """Neighbouring fixes of like accuracy."""

    def __init__(
        self, poses: FloatArray, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray
    ) -> None:
        self._poses, self._t_s, self._fixes, self._antenna = poses, t_s, fixes, camera_p_antenna
        alike = np.isclose(np.diff(fixes.r_m), 0.0)
        self._rows = np.flatnonzero(alike & (np.diff(fixes.t_s) <= _LONGEST_S))
        self._way = np.diff(fixes.world_p_fix[:, :2], axis=0)[self._rows]

    @property
    def count(self) -> int:
        """How many."""
        return len(self._rows)

    def _disagreement(self, lag_s: float) -> FloatArray:
        placement = place(self._t_s, self._fixes.t_s - lag_s, beyond=True)
        antenna = antenna_at(self._poses, placement, self._antenna)[:, :2]
        return np.asarray(np.diff(antenna, axis=0)[self._rows] - self._way)

    def apart(self, lag_s: float) -> FloatArray:
        """(n,) lengths of the disagreements, metres."""
        return np.asarray(np.linalg.norm(self._disagreement(lag_s), axis=1))

    def step(self, lag_s: float, believed: Lag) -> tuple[float, float]:
        """Gauss-Newton step of the reweighted problem, and the standard deviation there."""
        apart = self._disagreement(lag_s)
        by_lag = (self._disagreement(lag_s + _DELTA_S) - apart) / _DELTA_S
        length = np.linalg.norm(apart, axis=1)
        spread = _spread(length)
        weight = 1.0 / (1.0 + (length / (_WIDTH * spread)) ** 2) / spread**2
        information = float(np.sum(weight[:, None] * by_lag**2)) + believed.sigma_s**-2
        gradient = float(np.sum(weight[:, None] * by_lag * apart))
        gradient += (lag_s - believed.lag_s) / believed.sigma_s**2
        return -gradient / information, information**-0.5

    def gain(self, lag_s: float, other_s: float) -> float:
        """Twice the log of how much more likely a lag is than another one: 9 is as rare by chance as three
        standard deviations."""
        if self.count == 0:
            return 0.0
        length, other = self.apart(lag_s), self.apart(other_s)
        bend = _WIDTH * _spread(length)
        losses = [np.log1p((apart / bend) ** 2).sum() for apart in (length, other)]
        return _WIDTH**2 * float(losses[1] - losses[0])


def _spread(length: FloatArray) -> float:
    """On an axis: the median length of a Gaussian in the plane is 1.18 of it."""
    return max(float(np.median(length)) / 1.1774, _LEAST_M)

"""A gyro's rates integrated between any two times, many intervals at once."""

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from vgps.model import BoolArray, FloatArray, GyroLog

_GAP = 5.0  # so many sample intervals without a sample are a gap
_MIN_STEPS = 4


class GyroIntegral:
    """Rotations between times from rates that are straight between the samples.

    Args:
        gyro: The log, on the clock of the times that are asked for later.
    """

    def __init__(self, gyro: GyroLog) -> None:
        self._t_s = gyro.t_s
        self._angle = make_interp_spline(gyro.t_s, gyro.rate_rad_s, k=1).antiderivative()
        steps = np.diff(gyro.t_s)
        self.interval_s = float(np.median(steps))
        self._gap_starts = gyro.t_s[:-1][steps > _GAP * self.interval_s]
        self._gap_ends = gyro.t_s[1:][steps > _GAP * self.interval_s]

    def covers(self, start_s: FloatArray, end_s: FloatArray) -> BoolArray:
        """(P,) whether each interval from (P,) to (P,) lies within the log and touches no gap in it."""
        inside = (start_s >= self._t_s[0]) & (end_s <= self._t_s[-1])
        # as many gaps end before the interval's start as begin before its end
        over = np.searchsorted(self._gap_ends, start_s, side="right")
        begun = np.searchsorted(self._gap_starts, end_s, side="left")
        return np.asarray(inside & (over == begun))

    def mean_rates(self, start_s: FloatArray, end_s: FloatArray) -> FloatArray:
        """(P, 3) mean rates over intervals from (P,) to (P,)."""
        return np.asarray((self._angle(end_s) - self._angle(start_s)) / (end_s - start_s)[:, None])

    def steps(self, start_s: float, end_s: float) -> tuple[FloatArray, FloatArray]:
        """Mean rates (N, 3) and lengths (N,) of the short intervals between two times, cut at the samples."""
        between = self._t_s[(self._t_s > start_s) & (self._t_s < end_s)]
        times = np.concatenate([[start_s], between, [end_s]])
        return self.mean_rates(times[:-1], times[1:]), np.diff(times)

    def turns(
        self, start_s: FloatArray, end_s: FloatArray, bias_rad_s: FloatArray | None = None
    ) -> FloatArray:
        """Rotations (P, 3, 3), start_R_end, from the gyro's axes at each end to those at its start.

        Eq. (3), Matsuda 2007, with the exact exponential of every short step, as long as a sample or shorter.

        Args:
            start_s, end_s: (P,).
            bias_rad_s: (3,) taken off the rates.
        """
        count = len(start_s)
        if count == 0:
            return np.zeros((0, 3, 3))
        n = max(_MIN_STEPS, int(np.ceil(np.max(end_s - start_s) / self.interval_s)))
        times = start_s[:, None] + (end_s - start_s)[:, None] * np.linspace(0, 1, n + 1)
        angles = np.diff(self._angle(times), axis=1)
        if bias_rad_s is not None:
            angles = angles - np.asarray(bias_rad_s) * np.diff(times, axis=1)[:, :, None]
        turn = Rotation.identity(count)
        for k in range(n):
            turn = turn * Rotation.from_rotvec(angles[:, k])
        return np.asarray(turn.as_matrix(), np.float64)

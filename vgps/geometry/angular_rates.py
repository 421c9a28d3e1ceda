"""Rotations over many time intervals at once: of a camera, and integrals of a gyro's rates."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from vgps.model import BoolArray, FloatArray, GyroLog

_GAP = 5.0  # sample intervals; a longer time without samples is a gap
_MIN_STEPS = 4  # integration steps over even the shortest interval


@dataclass(frozen=True, kw_only=True)
class RelativeRotations:
    """Rotations of the camera over P time intervals.

    Attributes:
        start_s, end_s: (P,) times of the two frames.
        start_R_end: (P, 3, 3) from the camera's axes at the end to those at the start.
        covariance: (P, 3, 3) of ``Log`` of the rotation, in the camera's axes at the end, rad^2.
        missed: Number of intervals without a rotation: too few features, or no rigid scene.
    """

    start_s: FloatArray
    end_s: FloatArray
    start_R_end: FloatArray
    covariance: FloatArray
    missed: int

    def __len__(self) -> int:
        return len(self.start_s)

    def mean_rates(self) -> FloatArray:
        """Return the mean angular rate (P, 3) of each interval, in the camera's axes, rad/s."""
        vectors = Rotation.from_matrix(self.start_R_end).as_rotvec()
        return np.asarray(vectors / (self.end_s - self.start_s)[:, None])

    def where(self, kept: BoolArray) -> "RelativeRotations":
        """Return the intervals that a mask (P,) keeps; the others count as missed."""
        return RelativeRotations(
            start_s=self.start_s[kept],
            end_s=self.end_s[kept],
            start_R_end=self.start_R_end[kept],
            covariance=self.covariance[kept],
            missed=self.missed + int((~kept).sum()),
        )


class GyroIntegral:
    """Integral of a gyro's rates, interpolated linearly between samples.

    Args:
        gyro: The log; all methods take times on its clock.
    """

    def __init__(self, gyro: GyroLog) -> None:
        self._t_s = gyro.t_s
        self._angle = make_interp_spline(gyro.t_s, gyro.rate_rad_s, k=1).antiderivative()
        steps = np.diff(gyro.t_s)
        self.interval_s = float(np.median(steps))
        self._gap_starts = gyro.t_s[:-1][steps > _GAP * self.interval_s]
        self._gap_ends = gyro.t_s[1:][steps > _GAP * self.interval_s]

    def covers(self, start_s: FloatArray, end_s: FloatArray) -> BoolArray:
        """Return whether each interval (P,) from (P,) to (P,) is inside the log and touches no gap."""
        inside = (start_s >= self._t_s[0]) & (end_s <= self._t_s[-1])
        # every gap that begins before the interval's end also ends before its start
        over = np.searchsorted(self._gap_ends, start_s, side="right")
        begun = np.searchsorted(self._gap_starts, end_s, side="left")
        return np.asarray(inside & (over == begun))

    def mean_rates(self, start_s: FloatArray, end_s: FloatArray) -> FloatArray:
        """Return (P, 3) mean rates over intervals from (P,) to (P,), rad/s."""
        return np.asarray((self._angle(end_s) - self._angle(start_s)) / (end_s - start_s)[:, None])

    def steps(self, start_s: float, end_s: float) -> tuple[FloatArray, FloatArray]:
        """Return mean rates (N, 3) and lengths (N,) between two times, split at the samples."""
        between = self._t_s[(self._t_s > start_s) & (self._t_s < end_s)]
        times = np.concatenate([[start_s], between, [end_s]])
        return self.mean_rates(times[:-1], times[1:]), np.diff(times)

    def relative_rotations(
        self, start_s: FloatArray, end_s: FloatArray, bias_rad_s: FloatArray | None = None
    ) -> FloatArray:
        """Return start_R_end (P, 3, 3), from the gyro's axes at each end to those at its start.

        Eq. (3), Matsuda 2007, with the exact exponential of steps no longer than a sample.

        Args:
            start_s, end_s: (P,).
            bias_rad_s: (3,) subtracted from the rates.
        """
        count = len(start_s)
        if count == 0:
            return np.zeros((0, 3, 3))
        n = max(_MIN_STEPS, int(np.ceil(np.max(end_s - start_s) / self.interval_s)))
        times = start_s[:, None] + (end_s - start_s)[:, None] * np.linspace(0, 1, n + 1)
        angles = np.diff(self._angle(times), axis=1)
        if bias_rad_s is not None:
            angles = angles - np.asarray(bias_rad_s) * np.diff(times, axis=1)[:, :, None]
        steps = Rotation.from_rotvec(angles.reshape(-1, 3)).as_matrix().reshape(count, n, 3, 3)
        while steps.shape[1] > 1:  # each time neighbours become one
            even = steps.shape[1] // 2 * 2
            steps = np.concatenate([steps[:, :even:2] @ steps[:, 1:even:2], steps[:, even:]], axis=1)
        return np.asarray(steps[:, 0], np.float64)

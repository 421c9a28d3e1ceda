"""What a time offset leaves of the fixes' displacements; whether one explains them better than another."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded
from scipy.optimize import brentq

from vgps.config import TimeOffsetConfig
from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes
from vgps.gps.frame_gaps import in_gaps
from vgps.gps.knots import ComplexArray, Knots
from vgps.gps.neighbour_pairs import MEDIAN, MIN_SPREAD_M
from vgps.gps.time_offset import min_gain
from vgps.model import FloatArray, IntArray
from vgps.solution import Trajectory

MIN_PAIRS = 5  # ten residuals, of which two knots and the time offset take five
_MIN_COMMON_PAIRS = 8  # for a comparison by these alone
_REWEIGHTINGS = 4
_MOVING = 0.75  # quantile of displacements; a quarter may be wrong, three quarters those of a stop
_VIDEO_SHARE = 0.02  # of the motion that a video's own errors may leave
_CHANGE = 0.1  # of its region, by which an error that lasts half a minute changes within a second
_LEAST_SCALE = 1e-3  # of the differences, for motions that agree exactly, as simulated ones may
_CAUCHY_MEAN = 2.0 / 3.0  # of r^2 / (scale^2 + r^2) at the likeliest scale of Cauchy vectors in the plane


class Misfit(NamedTuple):
    """What is left of the fixes' displacements at a time offset.

    Attributes:
        left: (n,) lengths, over those of the displacements themselves.
        usual: (n,) lengths that errors of fixes of such classes, and of the video, may well leave, likewise.
        rows: (n,) the first fixes of the pairs within the video.
        degrees_of_freedom: Of the two residuals of each pair.
    """

    left: FloatArray
    usual: FloatArray
    rows: IntArray
    degrees_of_freedom: int

    @property
    def share(self) -> float:
        """Share of the motion that is left; a wrong fix counts as no motion."""
        return float(np.mean(np.minimum(self.left, 1.0) ** 2)) if len(self.left) else np.inf

    @property
    def cost(self) -> float:
        """Twice the negative log-likelihood per residual, two a pair, but for a constant.

        Of the likelier of Gaussian and Cauchy differences, each at its likeliest scale: with Cauchy's, the
        leap of an RTK-float that settles anew, or a wrong fix, does not hide how well all others agree.
        """
        if not len(self.left):
            return np.inf
        gaussian = np.log(max(float(np.mean(self.left**2)) / 2.0, _LEAST_SCALE**2)) + 1.0
        return float(min(gaussian, _cauchy_cost(self.left)))

    @property
    def over_usual(self) -> "Misfit":
        """That of lengths over the usual ones, by which fixes of different classes compare."""
        return self._replace(left=self.left / self.usual, usual=np.ones_like(self.usual))

    def among(self, rows: IntArray) -> "Misfit":
        """Return that of some of the pairs."""
        chosen = np.isin(self.rows, rows)
        freedom = self.degrees_of_freedom - 2 * int(np.sum(~chosen))
        return Misfit(self.left[chosen], self.usual[chosen], self.rows[chosen], freedom)

    def clearly_less(self, other: "Misfit", significance_sigmas: float, tried: float) -> bool:
        """Return whether this explains the fixes beyond doubt better than another time offset.

        By the likelihoods of the pairs that both have within the video: a wrong fix that one of them leaves
        out says nothing. Where these are few, or no more than the knots' parameters, each with its own, over
        what is usual: a straight at walking pace fits RTK-fixes better than the right stretch of RTK-floats.
        One without pairs says nothing. Of Gaussian differences it would be the F-test of one parameter.

        Args:
            other: Of the other time offset.
            significance_sigmas: As standard deviations of a single trial.
            tried: Number of trials.
        """
        if not len(other.left):
            return False
        common = np.intersect1d(self.rows, other.rows)
        this = self.among(common)
        if len(common) >= max(_MIN_COMMON_PAIRS, 2 * len(common) - this.degrees_of_freedom):
            other = other.among(common)
        else:
            this, other = self.over_usual, other.over_usual
        freedom = this.degrees_of_freedom
        if freedom < 1:
            return False
        least = np.log1p(min_gain(significance_sigmas, freedom, tried) / freedom)
        return bool(other.cost - this.cost > least)


class Seen(NamedTuple):
    """The antenna (F,) in the plane at the times of the frames (F,), as the camera moved it."""

    t_s: FloatArray
    antenna: ComplexArray


def seen_antenna(path: Trajectory, camera_p_antenna: FloatArray) -> Seen:
    """Return the antenna along a path; ``camera_p_antenna`` is (3,) metres."""
    antenna = path.world_T_camera[:, :3, :3] @ camera_p_antenna + path.world_T_camera[:, :3, 3]
    return Seen(path.t_s, antenna[:, 0] + 1j * antenna[:, 1])


def misfit_at(seen: Seen, fixes: Fixes, offset_s: float, config: TimeOffsetConfig) -> Misfit:
    """Return what the camera's displacements leave of those of the fixes within the video, not in a gap."""
    t_s = fixes.t_s - offset_s
    inside = (t_s >= seen.t_s[0]) & (t_s <= seen.t_s[-1]) & ~in_gaps(seen.t_s, t_s)
    rows = np.flatnonzero(inside[:-1] & inside[1:] & (np.diff(t_s) <= config.max_pair_s))
    if len(rows) < MIN_PAIRS:
        return Misfit(np.zeros(0), np.zeros(0), rows[:0], 0)
    camera = np.diff(np.interp(t_s, seen.t_s, seen.antenna))[rows]
    wanted = np.diff(fixes.world_p_fix[:, 0] + 1j * fixes.world_p_fix[:, 1])[rows]
    knots_s = np.linspace(t_s[rows[0]], t_s[rows[-1]], 2 + int(np.ptp(t_s[rows]) / config.knot_s))
    knots = Knots(place(knots_s, t_s[rows]), len(knots_s))
    difference = _difference(camera, wanted, knots, config)
    length = np.abs(wanted)
    bound = max(float(np.quantile(length, _MOVING)), MIN_SPREAD_M)  # a displacement while it moves
    moved = max(float(np.sqrt(np.mean(np.minimum(length, bound) ** 2))), MIN_SPREAD_M)
    changes = _CHANGE * np.sqrt(np.diff(t_s)[rows]) * np.maximum(fixes.r_m[rows], fixes.r_m[rows + 1])
    usual = np.hypot(_VIDEO_SHARE, changes / moved)
    return Misfit(np.abs(difference) / moved, usual, rows, 2 * len(rows) - 2 * knots.count - 1)


def _cauchy_cost(lengths: FloatArray) -> float:
    """Return the cost (see :attr:`Misfit.cost`) of vectors (n,) in the plane by Cauchy's distribution."""
    squares = lengths**2

    def beyond(log_scale: float) -> float:
        return float(np.mean(squares / (np.exp(2.0 * log_scale) + squares))) - _CAUCHY_MEAN

    log_scale = float(np.log(_LEAST_SCALE))
    if beyond(log_scale) > 0.0:
        log_scale = float(brentq(beyond, log_scale, np.log(2.0 * lengths.max()), xtol=1e-3))
    return float(2.0 * log_scale + 1.5 * np.mean(np.log1p(squares * np.exp(-2.0 * log_scale))))


def _difference(
    camera: ComplexArray, wanted: ComplexArray, knots: Knots, config: TimeOffsetConfig
) -> ComplexArray:
    """Return the differences (n,) at the best factor in common and its changes at the knots, reweighted."""
    weight: FloatArray = np.ones(len(camera))
    difference = wanted
    for _ in range(_REWEIGHTINGS):
        common = complex(np.vdot(camera, weight * wanted)) / max(float(weight @ np.abs(camera) ** 2), 1e-12)
        prior = (_spread(camera * common - wanted) / (config.factor_sigma * max(abs(common), 1e-6))) ** 2
        band = knots.normal_band(weight * np.abs(camera) ** 2)
        band[1] += prior
        right = knots.sums(weight * camera.conj() * wanted) + prior * common
        factor = np.asarray(solveh_banded(band, right), np.complex128)
        difference = camera * knots.interpolated(factor) - wanted
        bend = config.robust_spreads * _spread(difference)
        weight = 1.0 / (1.0 + np.abs(difference / bend) ** 2)
    return difference


def _spread(difference: ComplexArray) -> float:
    return max(float(np.median(np.abs(difference))) / MEDIAN, MIN_SPREAD_M)

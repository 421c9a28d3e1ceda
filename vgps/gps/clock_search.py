"""A GPS clock that is wrong by seconds, found by the shape of the path.

Displacements between neighbouring fixes are compared with those of the camera over the same time at every
time offset, each at the best slowly changing scale and heading. A clock that is wrong by more than a turn
lasts has no gradient to follow, so all offsets are tried; one counts if no other explains the fixes nearly
as well.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from vgps.config import SensorsConfig, TimeOffsetConfig
from vgps.gps.fixes import Fixes, place
from vgps.gps.knots import ComplexArray, Knots
from vgps.gps.neighbour_pairs import MEDIAN, MIN_SPREAD_M
from vgps.gps.time_offset import min_gain, spaced, spacing_s
from vgps.model import FloatArray, IntArray
from vgps.solution import GpsClock, Trajectory

_REACH_S = 60.0  # to either side; GPS time, taken for UTC, is 18 s ahead
_STEP_S = 0.2  # a fraction of the time that a turn takes
_FINE_STEP_S = 0.02  # around the offset found: a run that begins nearer to the right one ends nearer to it
_MIN_PAIRS = 5  # ten residuals, of which two knots and the time offset take five
_MIN_COMMON_PAIRS = 8  # for a comparison by these alone
_MIN_SHARE = 0.5  # of the pairs that the best overlap has
_REWEIGHTINGS = 4
_MOVING = 0.75  # quantile of displacements; a quarter may be wrong, three quarters those of a stop
_EXPLAINED_SHARE = 0.1  # of the motion that may be left of fixes which a path explains
_VIDEO_SHARE = 0.02  # of the motion that a video's own errors may leave
_CHANGE = 0.1  # of its region, by which an error that lasts half a minute changes within a second
_LEAST_SCALE = 1e-3  # of the differences, for motions that agree exactly, as simulated ones may
_CAUCHY_MEAN = 2.0 / 3.0  # of r^2 / (scale^2 + r^2) at the likeliest scale of Cauchy vectors in the plane


class ClockCheck(NamedTuple):
    """What was found when the GPS clock was compared with a path of the video alone.

    Attributes:
        shown_s: Time offset that its shape shows; None if it shows none.
        torn: Whether most fixes are outside their regions all the same: the path has been torn to them.
        other: The clock that displacements show if it has another rate; None if they show none.
        video: That path; None if there was none to compare.
    """

    shown_s: float | None
    torn: bool = False
    other: GpsClock | None = None
    video: Trajectory | None = None


class _Misfit(NamedTuple):
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
        return _cost(self.left)

    @property
    def cost_over_usual(self) -> float:
        """The same of lengths over the usual ones, to compare fixes of different classes."""
        return _cost(self.left / self.usual)

    def among(self, rows: IntArray) -> "_Misfit":
        """Return that of some of the pairs."""
        chosen = np.isin(self.rows, rows)
        freedom = self.degrees_of_freedom - 2 * int(np.sum(~chosen))
        return _Misfit(self.left[chosen], self.usual[chosen], self.rows[chosen], freedom)

    def clearly_less(self, other: "_Misfit", significance_sigmas: float, tried: float) -> bool:
        """Return whether this explains the fixes beyond doubt better than another time offset.

        By the likelihoods of the pairs that both have within the video: a wrong fix that one of them leaves
        out says nothing. Where these are too few, each with its own, over what is usual: a straight at
        walking pace fits RTK-fixes better than the right stretch of RTK-floats. One without pairs says
        nothing. Of Gaussian differences it would be the F-test of one parameter.

        Args:
            other: Of the other time offset.
            significance_sigmas: As standard deviations of a single trial.
            tried: Number of trials.
        """
        if not len(other.left):
            return False
        common = np.intersect1d(self.rows, other.rows)
        if len(common) >= _MIN_COMMON_PAIRS:
            this, other = self.among(common), other.among(common)
            freedom, gain = this.degrees_of_freedom, other.cost - this.cost
        else:
            freedom, gain = self.degrees_of_freedom, other.cost_over_usual - self.cost_over_usual
        if freedom < 1:
            return False
        return bool(gain > np.log1p(min_gain(significance_sigmas, freedom, tried) / freedom))


def search_time_offset(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> float | None:
    """Return the time offset that the motion shows beyond doubt; None if it shows none.

    The fixes may be far off the path: neither its place, nor its scale, nor its heading counts. Wrong ones
    make the offset less sure, so that a log with many of them shows none.

    Args:
        path: Of the video alone, level; every scale and heading will do.
        fixes: Fixes at the times of their time stamps, wrong ones among them; used ones count.
        camera_p_antenna: (3,) metres.
        config: How far around an offset others are taken for the same, and how sure it must be.
    """
    offsets_s, found, cost = _searched(path, fixes, camera_p_antenna, config)
    best = int(np.argmin(cost))
    reach_s = config.time_offset_reach_s
    others = np.flatnonzero(np.isfinite(cost) & (np.abs(offsets_s - offsets_s[best]) > reach_s))
    tried = 1.0 + len(others) * _STEP_S / reach_s
    clear = (found[best].clearly_less(found[k], config.significance_sigmas, tried) for k in others.tolist())
    if not len(others) or not all(clear):
        return None
    near_s = offsets_s[best] + np.arange(-_STEP_S, _STEP_S + _FINE_STEP_S / 2, _FINE_STEP_S)
    costs = [one.cost for one in _misfits(near_s, path, fixes, camera_p_antenna, config)]
    return round(float(near_s[int(np.argmin(costs))]), 2)


def unexplained_share(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> float:
    """Return the share of the fixes' motion that the path leaves at the time offset that suits them best.

    Args:
        path, fixes, camera_p_antenna, config: As for :func:`search_time_offset`.
    """
    _, found, cost = _searched(path, fixes, camera_p_antenna, config)
    return found[int(np.argmin(cost))].share


def _searched(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> tuple[FloatArray, list[_Misfit], FloatArray]:
    """Return the time offsets (n,), what is left at each, and its cost, infinite without enough pairs."""
    offsets_s = config.time_offset_s + np.arange(-_REACH_S, _REACH_S + _STEP_S / 2, _STEP_S)
    found = _misfits(offsets_s, path, fixes, camera_p_antenna, config)
    pairs = np.array([len(one.left) for one in found])
    overlapping = pairs >= max(_MIN_PAIRS, _MIN_SHARE * pairs.max())
    return offsets_s, found, np.where(overlapping, [one.cost for one in found], np.inf)


def _misfits(
    offsets_s: FloatArray,
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: SensorsConfig,
) -> list[_Misfit]:
    """Return what is left at each of some time offsets."""
    seen, chosen = _seen(path, camera_p_antenna), _chosen(fixes)
    return [_misfit(seen, chosen, offset_s, config.time_offset) for offset_s in offsets_s.tolist()]


def shows_no_time_offset(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> bool:
    """Return whether the motion explains the fixes as well at other time offsets near the configured one.

    So it does on a straight or in a circle at constant speed, where another one is another place or heading.

    Args:
        path, fixes, camera_p_antenna, config: As for :func:`search_time_offset`.
    """
    offsets_s = np.array([config.time_offset_s, *_near(config)])
    held, *others = _misfits(offsets_s, path, fixes, camera_p_antenna, config)
    tried = float(len(others))
    return not any(held.clearly_less(other, config.significance_sigmas, tried) for other in others)


def is_mirrored(path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig) -> bool:
    """Return whether the mirror image of a path explains the fixes, and the path does not, beyond doubt.

    Turns to the left are turns to the right then, as in a mirrored picture or above a camera upside down.

    Args:
        path: Of the video alone, upright.
        fixes, camera_p_antenna, config: As for :func:`search_time_offset`.
    """
    seen, chosen = _seen(path, camera_p_antenna), _chosen(fixes)
    offsets_s = _near(config)

    def least(one: _Seen) -> _Misfit:
        found = (_misfit(one, chosen, offset_s, config.time_offset) for offset_s in offsets_s.tolist())
        return min(found, key=lambda misfit: misfit.cost)

    right, mirrored = least(seen), least(seen._replace(antenna=seen.antenna.conj()))
    explained = mirrored.share < _EXPLAINED_SHARE
    return explained and mirrored.clearly_less(right, config.significance_sigmas, float(len(offsets_s)))


def _near(config: SensorsConfig) -> FloatArray:
    """Return the time offsets that the search by displacements reaches."""
    reach_s = config.time_offset_reach_s
    return np.asarray(config.time_offset_s + np.arange(-reach_s, reach_s + _STEP_S / 2, _STEP_S))


def levelled(path: Trajectory) -> Trajectory:
    """Return a path in any frame, turned so that the plane of its motion is level.

    A camera looks ahead or down, upright, which tells above from below.
    """
    poses = path.world_T_camera
    centres = poses[:, :3, 3] - poses[:, :3, 3].mean(axis=0)
    up = np.linalg.eigh(centres.T @ centres)[1][:, 0]
    up *= -np.sign(up @ (poses[:, :3, 1] + poses[:, :3, 2]).mean(axis=0)) or 1.0
    level_T_world = np.eye(4)
    level_T_world[:3, :3] = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])[0].as_matrix()
    return Trajectory(path.t_s, level_T_world @ poses)


class _Seen(NamedTuple):
    """The antenna (F,) in the plane at the times of the frames (F,), as the camera moved it."""

    t_s: FloatArray
    antenna: ComplexArray


def _seen(path: Trajectory, camera_p_antenna: FloatArray) -> _Seen:
    antenna = path.world_T_camera[:, :3, :3] @ camera_p_antenna + path.world_T_camera[:, :3, 3]
    return _Seen(path.t_s, antenna[:, 0] + 1j * antenna[:, 1])


def _chosen(fixes: Fixes) -> Fixes:
    """Return the fixes that are compared."""
    used = fixes.where(fixes.used)
    return spaced(used, spacing_s(used))


def _misfit(seen: _Seen, fixes: Fixes, offset_s: float, config: TimeOffsetConfig) -> _Misfit:
    """Return what the camera's displacements leave of those of the fixes within the video."""
    t_s = fixes.t_s - offset_s
    inside = (t_s >= seen.t_s[0]) & (t_s <= seen.t_s[-1])
    rows = np.flatnonzero(inside[:-1] & inside[1:] & (np.diff(t_s) <= config.max_pair_s))
    if len(rows) < _MIN_PAIRS:
        return _Misfit(np.zeros(0), np.zeros(0), rows[:0], 0)
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
    return _Misfit(np.abs(difference) / moved, usual, rows, 2 * len(rows) - 2 * knots.count - 1)


def _cost(lengths: FloatArray) -> float:
    """Return twice the negative log-likelihood of vectors (n,) per component, see :class:`_Misfit`."""
    if not len(lengths):
        return np.inf
    gaussian = np.log(max(float(np.mean(lengths**2)) / 2.0, _LEAST_SCALE**2)) + 1.0
    return float(min(gaussian, _cauchy_cost(lengths)))


def _cauchy_cost(lengths: FloatArray) -> float:
    """Return the cost (see :class:`_Misfit`) of vectors (n,) in the plane by Cauchy's distribution."""
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

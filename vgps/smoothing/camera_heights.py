"""The ground below a moving camera: its height above the landmarks that the path passes over.

A wheeled camera keeps its height above the ground. In the unit of a map, which video alone leaves open, that
height is measured stretch by stretch; a known height then gives the unit. Coordinates of a landmark are those
in the frame that passes it: ``down`` is perpendicular to the motion, ``across`` to both. The ground is where
many landmarks have one height, few lie below it and the height hardly changes:

    down_i = h_k (1 + a_k across_i / h_k),   log h_k walks at random from stretch to stretch.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded
from scipy.spatial import cKDTree

from vgps.geometry import travelled
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.smoothing.factor_graph import Scene

STRETCH = 6.0  # heights: a stretch is long enough for a dozen landmarks, short enough for one height
_ACROSS = 2.0  # heights to either side: a lane
_PASSED = 10.0  # heights between the last frame that observes a landmark and the frame that passes it
_BANDS = (0.2, 0.12, 0.08, 0.06)  # share of the height within which a landmark may be the ground, in turn
_LEAST_SCATTER = 0.005
_WALK = 0.05  # standard deviation of log scale from stretch to stretch: the drift of a video at its worst
_TILT_RAD = np.radians(1.5)  # of the ground across the path, from stretch to stretch: camber, suspension
_MOST_TILT_RAD = np.radians(10.0)  # a camera that is held more askew than this stands on no plane
_MIN_LANDMARKS = 6
_SIGNIFICANT = 4.0  # standard deviations by which landmarks in the plane outnumber chance
_MIN_SHARE = 0.1  # of the stretches
_UNEVEN = 0.01  # of the height: what suspension and camber change it at least from stretch to stretch


@dataclass(frozen=True, kw_only=True)
class CameraHeights:
    """Stretches of a path that have a plane below them.

    Attributes:
        first, last: (K,) frames at the ends of a stretch.
        height: (K,) of the camera above the plane, in the map's unit.
        sigma: (K,) standard deviations of log height: landmarks, and unevenness of the ground.
        stretches: Number of all stretches.
    """

    first: IntArray
    last: IntArray
    height: FloatArray
    sigma: FloatArray
    stretches: int


class _Passed(NamedTuple):
    """Landmarks that the path passes: ``foot`` (n,) the frames, ``across``, ``down`` (n,) map units."""

    foot: IntArray
    across: FloatArray
    down: FloatArray


class _Fit(NamedTuple):
    """Log heights and slopes (K,) of all stretches, and of each landmark its stretch and relative error."""

    log_height: FloatArray
    slope: FloatArray
    stretch: IntArray
    error: FloatArray


def measure_heights(scene: Scene) -> CameraHeights | str:
    """Return the ground below the path of a scene, or a sentence that says why there is none."""
    length = travelled(scene.poses[:, :3, 3])
    coarse = _passed(scene, length, 0.01 * length[-1], np.inf)
    height = _commonest_height(coarse)
    if height is None:
        return "no landmarks lie below the camera where it passes them"
    stretches = _stretches(length, height)
    if len(stretches) < 3:
        return (
            f"the path is shorter than {2 * STRETCH:g} times the height of the camera above what is below it"
        )
    passed = _passed(scene, length, 2.0 * height, _PASSED * height)
    fit = _fit(passed, stretches, height)
    counts = _counts(fit, len(stretches) - 1)
    flat = counts.inside - counts.by_chance > _SIGNIFICANT * np.sqrt(counts.by_chance + 1.0)
    flat &= counts.inside >= _MIN_LANDMARKS
    if flat.sum() < max(2, _MIN_SHARE * len(flat)):
        return f"landmarks below the camera lie in a plane in {flat.sum()} of {len(flat)} stretches only"
    tilt = float(np.arctan(np.median(fit.slope[flat])))
    if abs(tilt) > _MOST_TILT_RAD:
        return f"the surface below the camera is tilted by {np.degrees(abs(tilt)):.0f} degrees sideways"
    log_height, sigma = _by_stretch(fit, passed, flat)
    first, last = stretches[:-1][flat], stretches[1:][flat]
    return CameraHeights(
        first=first,
        last=last,
        height=np.exp(log_height),
        sigma=np.hypot(sigma, _unevenness(log_height)),
        stretches=len(flat),
    )


def _passed(scene: Scene, length: FloatArray, reach: float, gap: float) -> _Passed:
    """Return the landmarks that the path passes soon after it has observed them.

    Args:
        scene: The scene.
        length: (F,) of the path up to each frame.
        reach: Length of the path to either side that gives the direction of motion.
        gap: Length of the path from the last observation to the frame that passes.
    """
    centre, seen = scene.poses[:, :3, 3], scene.observations
    last = np.full(len(scene.points), -1)
    np.maximum.at(last, seen.landmark, seen.frame)
    rows = np.flatnonzero((last >= 0) & np.isfinite(scene.points).all(axis=1))
    foot = np.asarray(cKDTree(centre).query(scene.points[rows])[1])
    ends = np.searchsorted(length, np.stack([length[foot] - reach, length[foot] + reach]))
    begin, end = np.clip(ends, 0, len(centre) - 1)
    forward = centre[end] - centre[begin]
    ahead = length[foot] - length[last[rows]]
    whole = (length[foot] > reach) & (length[foot] < length[-1] - reach)  # else it may lie before or behind
    kept = whole & (ahead > -gap) & (ahead < gap)
    rows, foot, forward = rows[kept], foot[kept], forward[kept]
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    down = scene.poses[foot, :3, 1]
    down = down - np.sum(down * forward, axis=1, keepdims=True) * forward
    down /= np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-9)
    offset = scene.points[rows] - centre[foot]
    return _Passed(foot, np.sum(offset * np.cross(down, forward), axis=1), np.sum(offset * down, axis=1))


def _commonest_height(passed: _Passed) -> float | None:
    """Return the height at which most landmarks lie, less those below it; None without landmarks below."""
    below = passed.down > 0.0
    if below.sum() < _MIN_LANDMARKS:
        return None
    down, across = passed.down[below], np.abs(passed.across[below])
    lowest, highest = np.quantile(down, [0.02, 0.98]).tolist()
    heights = np.geomspace(lowest, highest, 200)
    scores = []
    for height in heights:
        near = across < _ACROSS * height
        inside = np.maximum(0.0, 1.0 - np.abs(np.log(down[near] / height)) / 0.1).sum()
        scores.append(inside - np.sum(near & (down > 1.2 * height) & (down < 3.0 * height)))
    return float(heights[int(np.argmax(scores))])


def _stretches(length: FloatArray, height: float) -> IntArray:
    """Return the frames (K + 1,) between which the stretches lie."""
    return np.unique(np.searchsorted(length, np.arange(0.0, length[-1], STRETCH * height)))


def _fit(passed: _Passed, frames: IntArray, height: float) -> _Fit:
    """Return the heights and slopes of all stretches, from that of the whole path on."""
    stretch = np.searchsorted(frames, passed.foot, side="right") - 1
    stretch = np.where(stretch >= len(frames) - 1, -1, stretch)
    log_height, slope = np.full(len(frames) - 1, np.log(height)), np.zeros(len(frames) - 1)
    fit = _with_errors(_Fit(log_height, slope, stretch, passed.down), passed)
    for band in np.repeat(_BANDS, 4):
        weight = np.where(stretch >= 0, np.maximum(0.0, 1.0 - (fit.error / band) ** 2) ** 2, 0.0)
        fit = _with_errors(_step(fit, passed, weight), passed)
    return fit


def _with_errors(fit: _Fit, passed: _Passed) -> _Fit:
    """Return a fit with the error of each landmark, as a share of the height; infinite beside the lane."""
    height = np.exp(fit.log_height[fit.stretch])
    error = (passed.down - fit.slope[fit.stretch] * passed.across) / height - 1.0
    lane = np.abs(passed.across) < _ACROSS * height
    return fit._replace(error=np.where(lane & (fit.stretch >= 0), error, np.inf))


def _step(fit: _Fit, passed: _Passed, weight: FloatArray) -> _Fit:
    """Return the fit after a step of weighted least squares; heights walk, slopes differ from their mean."""
    normal, right = _normal_equations(fit, passed, weight)
    mean = float(np.median(fit.slope))
    normal[:, 1, 1] += _TILT_RAD**-2
    right[:, 1] += (mean - fit.slope) / _TILT_RAD**2
    share = normal[:, 0, 1] / normal[:, 1, 1]
    diagonal = normal[:, 0, 0] - share * normal[:, 0, 1]
    walk = np.full(len(diagonal) - 1, _WALK**-2)
    band = np.zeros((2, len(diagonal)))
    band[1] = diagonal + np.append(walk, 0.0) + np.append(0.0, walk) + 1e-6
    band[0, 1:] = -walk
    pull = np.append(walk * np.diff(fit.log_height), 0.0) - np.append(0.0, walk * np.diff(fit.log_height))
    by_height = solveh_banded(band, right[:, 0] - share * right[:, 1] + pull)
    by_slope = (right[:, 1] - normal[:, 0, 1] * by_height) / normal[:, 1, 1]
    return fit._replace(log_height=fit.log_height + by_height, slope=fit.slope + by_slope)


def _normal_equations(fit: _Fit, passed: _Passed, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the normal equations (K, 2, 2), (K, 2) of log height and slope, by stretch."""
    used = np.flatnonzero(weight)
    k, error = fit.stretch[used], fit.error[used]
    rows = np.stack([np.ones(len(used)), passed.across[used] / np.exp(fit.log_height[k])], axis=1)
    scatter = _scatter(error)
    weighted = weight[used, None] * rows / scatter**2
    normal, right = np.zeros((len(fit.slope), 2, 2)), np.zeros((len(fit.slope), 2))
    np.add.at(normal, k, weighted[:, :, None] * rows[:, None])
    np.add.at(right, k, weighted * error[:, None])
    return normal, right


def _scatter(error: FloatArray) -> float:
    """Return the robust standard deviation of the errors of landmarks in the plane."""
    return max(1.4826 * float(np.median(np.abs(error))), _LEAST_SCATTER) if len(error) else 1.0


class _Counts(NamedTuple):
    """Landmarks in the plane of each stretch, and how many the bands above and below let expect by chance."""

    inside: IntArray
    by_chance: FloatArray


def _counts(fit: _Fit, stretches: int) -> _Counts:
    size, band = np.abs(fit.error), _BANDS[-1]
    inside = np.bincount(fit.stretch[size < band], minlength=stretches)
    beside = np.bincount(fit.stretch[(size >= band) & (size < 3.0 * band)], minlength=stretches)
    return _Counts(inside, np.asarray(0.5 * beside, dtype=np.float64))


def _by_stretch(fit: _Fit, passed: _Passed, flat: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return log heights and their standard deviations of the stretches with a plane, each by its own."""
    weight = np.maximum(0.0, 1.0 - (fit.error / _BANDS[-1]) ** 2) ** 2
    normal, right = _normal_equations(fit, passed, np.where(np.isfinite(weight), weight, 0.0))
    normal[:, 1, 1] += _TILT_RAD**-2
    normal, right = normal[flat], right[flat]
    own = np.linalg.solve(normal, right[:, :, None])[:, 0, 0]
    sigma = np.sqrt(np.linalg.inv(normal)[:, 0, 0])
    return fit.log_height[flat] + own, sigma


def _unevenness(log_height: FloatArray) -> float:
    """Return the standard deviation of log height from stretch to stretch, beyond what drifts."""
    if len(log_height) < 6:
        return 2.0 * _UNEVEN
    second = np.diff(log_height, 2)  # of independent errors: variance 6 times theirs
    return max(float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0)), _UNEVEN)

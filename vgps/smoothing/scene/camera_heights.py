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

from vgps.geometry import travelled
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.smoothing.scene.passed_landmarks import PassedLandmarks, Plane, commonest_plane, passed_landmarks
from vgps.smoothing.scene.scene import Scene

STRETCH = 6.0  # heights: a stretch is long enough for a dozen landmarks, short enough for one height
_PASSED = 10.0  # heights between the last frame that observes a landmark and the frame that passes it
_BANDS = (0.2, 0.12, 0.08, 0.06)  # share of the height within which a landmark may be the ground, in turn
_LEAST_SCATTER = 0.005
_WALK = 0.05  # standard deviation of log scale from stretch to stretch: the drift of a video at its worst
_TILT_RAD = np.radians(1.5)  # of the ground across the path, from stretch to stretch: camber, suspension
_MOST_TILT_RAD = np.radians(30.0)  # seen steeper than this it may be a bank or a wall
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


class _Fit(NamedTuple):
    """Log heights and slopes (K,) of all stretches, and of each landmark its stretch and relative error."""

    log_height: FloatArray
    slope: FloatArray
    stretch: IntArray
    error: FloatArray


class _Ground(NamedTuple):
    """Heights above the ground, and the plane that it is on the whole."""

    heights: CameraHeights
    plane: Plane


def measure_heights(scene: Scene) -> CameraHeights | str:
    """Return the ground below the path of a scene, or a sentence that says why there is none."""
    length = travelled(scene.poses[:, :3, 3])
    plane = commonest_plane(passed_landmarks(scene, length, 0.01 * length[-1], np.inf))
    if plane is None:
        return "no landmarks lie below the camera where it passes them"
    found = _stretch_by_stretch(scene, length, plane)
    if isinstance(found, _Ground):  # again, from stretches of about six heights to those of six
        found = _stretch_by_stretch(scene, length, found.plane)
    if isinstance(found, str):
        return found
    tilt_rad = abs(found.plane.roll_rad)
    if tilt_rad > _MOST_TILT_RAD:
        return f"the surface below the camera is tilted by {np.degrees(tilt_rad):.0f} degrees sideways"
    return found.heights


def _stretch_by_stretch(scene: Scene, length: FloatArray, plane: Plane) -> _Ground | str:
    """Return the heights above the ground of all stretches near a plane, or why there is no ground."""
    frames = _stretches(length, plane.height)
    if len(frames) < 3:
        return (
            f"the path is shorter than {2 * STRETCH:g} times the height of the camera above what is below it"
        )
    passed = passed_landmarks(scene, length, 2.0 * plane.height, _PASSED * plane.height)
    passed = passed.rolled(plane.roll_rad)
    fit = _fit(passed, frames, plane.height)
    flat = _is_flat(fit, len(frames) - 1)
    if flat.sum() < max(2, _MIN_SHARE * len(flat)):
        return f"landmarks below the camera lie in a plane in {flat.sum()} of {len(flat)} stretches only"
    slope = float(np.arctan(np.median(fit.slope[flat])))
    log_height, sigma = _by_stretch(fit, passed, flat)
    height = np.exp(log_height) * np.cos(slope)
    heights = CameraHeights(
        first=frames[:-1][flat],
        last=frames[1:][flat],
        height=height,
        sigma=np.hypot(sigma, _unevenness(log_height)),
        stretches=len(flat),
    )
    return _Ground(heights, Plane(float(np.median(height)), plane.roll_rad + slope))


def _stretches(length: FloatArray, height: float) -> IntArray:
    """Return the frames (K + 1,) between which the stretches lie."""
    return np.unique(np.searchsorted(length, np.arange(0.0, length[-1], STRETCH * height)))


def _fit(passed: PassedLandmarks, frames: IntArray, height: float) -> _Fit:
    """Return the heights and slopes of all stretches, from that of the whole path on."""
    stretch = np.searchsorted(frames, passed.foot, side="right") - 1
    stretch = np.where(stretch >= len(frames) - 1, -1, stretch)
    log_height, slope = np.full(len(frames) - 1, np.log(height)), np.zeros(len(frames) - 1)
    fit = _with_errors(_Fit(log_height, slope, stretch, passed.down), passed)
    for band in np.repeat(_BANDS, 4):
        weight = np.where(stretch >= 0, np.maximum(0.0, 1.0 - (fit.error / band) ** 2) ** 2, 0.0)
        fit = _with_errors(_step(fit, passed, weight), passed)
    return fit


def _with_errors(fit: _Fit, passed: PassedLandmarks) -> _Fit:
    """Return a fit with the error of each landmark, as a share of the height; infinite beside the lane."""
    height = np.exp(fit.log_height[fit.stretch])
    error = (passed.down - fit.slope[fit.stretch] * passed.across) / height - 1.0
    return fit._replace(error=np.where(passed.in_lane(height) & (fit.stretch >= 0), error, np.inf))


def _step(fit: _Fit, passed: PassedLandmarks, weight: FloatArray) -> _Fit:
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


def _normal_equations(
    fit: _Fit, passed: PassedLandmarks, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
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


def _is_flat(fit: _Fit, stretches: int) -> BoolArray:
    """Return which stretches have more landmarks in the plane than the bands above and below let expect."""
    size, band = np.abs(fit.error), _BANDS[-1]
    inside = np.bincount(fit.stretch[size < band], minlength=stretches)
    beside = np.bincount(fit.stretch[(size >= band) & (size < 3.0 * band)], minlength=stretches)
    by_chance = 0.5 * beside
    many = inside - by_chance > _SIGNIFICANT * np.sqrt(by_chance + 1.0)
    return np.asarray(many & (inside >= _MIN_LANDMARKS))


def _by_stretch(fit: _Fit, passed: PassedLandmarks, flat: BoolArray) -> tuple[FloatArray, FloatArray]:
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

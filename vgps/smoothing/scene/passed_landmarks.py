"""Landmarks that a moving camera passes, in the section across its path, and the plane that most lie in."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.smoothing.scene.scene import Scene
from vgps.solver.equations.landmark_groups import track_ends

_HALF_WIDTH = 2.0  # heights to either side of the path: a lane
_MIN_LANDMARKS = 6
_ROLLS_RAD = np.radians(np.arange(-45.0, 46.0, 5.0))  # steeper than this it is a wall
_HEIGHTS = 100
_BAND = 0.1  # share of the height within which a landmark may lie in the plane
_DEEPER = 1.2, 3.0  # heights: below the plane, and not yet a mistake
_MANY = 0.7  # of the landmarks of the plane with the most: the more level one is the ground
_MOST = 4_000  # landmarks that are examined


class PassedLandmarks(NamedTuple):
    """Landmarks that the path passes: ``foot`` (n,) the frames, ``across``, ``down`` (n,) map units."""

    foot: IntArray
    across: FloatArray
    down: FloatArray

    def rolled(self, roll_rad: float) -> "PassedLandmarks":
        """Return the landmarks in a section whose ``down`` is turned by an angle, against ``across``."""
        cos, sin = np.cos(roll_rad), np.sin(roll_rad)
        return PassedLandmarks(
            self.foot, cos * self.across + sin * self.down, cos * self.down - sin * self.across
        )

    def chosen(self, rows: BoolArray | slice) -> "PassedLandmarks":
        """Return some of the landmarks."""
        return PassedLandmarks(self.foot[rows], self.across[rows], self.down[rows])

    def in_lane(self, height: FloatArray) -> BoolArray:
        """Return which landmarks (n,) are on the lane below a camera of a height, or of heights (K, 1)."""
        return np.asarray(np.abs(self.across) < _HALF_WIDTH * height)


class Plane(NamedTuple):
    """A plane along the path: its height below the camera, map units, and its slope down to the right."""

    height: float
    roll_rad: float


def passed_landmarks(scene: Scene, length: FloatArray, reach: float, gap: float) -> PassedLandmarks:
    """Return the landmarks that the path passes soon after it has observed them.

    Args:
        scene: The scene.
        length: (F,) of the path up to each frame.
        reach: Length of the path to either side that gives the direction of motion.
        gap: Length of the path from the last observation to the frame that passes.
    """
    centre, seen = scene.poses[:, :3, 3], scene.observations
    _, last = track_ends(seen.frame, seen.landmark, len(scene.points))
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
    return PassedLandmarks(
        foot, np.sum(offset * np.cross(down, forward), axis=1), np.sum(offset * down, axis=1)
    )


def commonest_plane(passed: PassedLandmarks) -> Plane | None:
    """Return the most level plane of those with many landmarks in them, less those below; None without."""
    few = passed.chosen(slice(None, None, 1 + len(passed.foot) // _MOST))
    if np.sum(few.down > 0.0) < _MIN_LANDMARKS:
        return None
    heights, scores = np.transpose([_height(few.rolled(roll)) for roll in _ROLLS_RAD.tolist()])
    most = float(scores.max())  # negative where landmarks lie scattered
    many = np.flatnonzero(scores >= most - (1.0 - _MANY) * abs(most))
    best = many[np.lexsort([-scores[many], np.abs(_ROLLS_RAD[many])])[0]]
    return Plane(float(heights[best]), float(_ROLLS_RAD[best]))


def _height(passed: PassedLandmarks) -> tuple[float, float]:
    """Return the height at which most landmarks lie, less those below it, and that number."""
    under = passed.chosen(passed.down > 0.0)
    if len(under.down) < _MIN_LANDMARKS:
        return np.nan, -np.inf
    lowest, highest = np.quantile(under.down, [0.02, 0.98]).tolist()
    heights = np.geomspace(lowest, highest, _HEIGHTS)
    ratio, near = under.down / heights[:, None], under.in_lane(heights[:, None])
    inside = near * np.maximum(0.0, 1.0 - np.abs(np.log(ratio)) / _BAND)
    deeper = near & (ratio > _DEEPER[0]) & (ratio < _DEEPER[1])
    score = inside.sum(axis=1) - deeper.sum(axis=1)
    best = int(np.argmax(score))
    return float(heights[best]), float(score[best])

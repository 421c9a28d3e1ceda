"""The ground that a camera travels over: it is level sideways to a degree or two, and so shows the roll.

A straight path does not show the camera's roll, however good the fixes: the rotation about the path leaves it
where it is. Roads and footpaths fall to the side by 1.5 to 2.5 % so that water runs off (AASHTO, A Policy on
Geometric Design of Highways and Streets, 2018, 4.2.2), which shows the roll better than the prior of a level
camera, and of a camera that is held askew, too. Where no plane lies under the path there is no ground.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vgps.config import StartConfig
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Observations, Trajectory
from vgps.solver.integer_sets import distinct

_STRETCH_M = 10.0  # of the path, with a plane of its own
_LONGEST_STEP_S = 10.0  # from frame to frame: beyond it the camera was elsewhere in between
_TRIALS = 400  # planes through two landmarks and along the path
_STEEPEST = np.tan(np.radians(35.0))  # sideways: walls are no ground, and the pose is not that wrong
# In heights of the camera above the plane:
_TOLERANCE = 0.04
_HALF_WIDTH, _HALF_LENGTH = 4.0, 15.0  # of the ground under the path, within which landmarks count
_MIN_LANDMARKS = 20
_BELOW = 2.0  # landmarks on the plane that one below it outweighs: nothing is seen through the ground
_MAD = 1.4826  # standard deviations in a median absolute deviation


@dataclass(frozen=True, kw_only=True)
class Terrain:
    """What the ground may be.

    Attributes:
        slope_sigma_rad: Standard deviation of its slope to the side.
        highest_m: Largest height of the camera above it.
        min_spread: Least standard deviation, sideways, of the landmarks on the plane, in heights.
    """

    slope_sigma_rad: float
    highest_m: float
    min_spread: float


def terrain(config: StartConfig) -> Terrain:
    """Return the road under a camera that travels on it, on a lorry at most; or the land below a drone."""
    if config.flies:
        return Terrain(
            slope_sigma_rad=float(np.radians(config.land_sigma_deg)), highest_m=np.inf, min_spread=0.1
        )
    slope_rad = float(np.radians(config.crossfall_sigma_deg))
    return Terrain(slope_sigma_rad=slope_rad, highest_m=4.0, min_spread=0.5)


@dataclass(frozen=True)
class Ground:
    """The vertical as the ground under a path shows it.

    Attributes:
        frame: (S,) a frame on each stretch of the path.
        camera_level: (S, 3) unit vector in the axes of that frame's camera, along the ground and square to
            the path: it is horizontal where the ground does not fall to the side.
        sigma_rad: (S,) standard deviations of these vectors' elevations, as if they were independent.
    """

    frame: IntArray
    camera_level: FloatArray
    sigma_rad: FloatArray


def find_ground(path: Trajectory, points: FloatArray, seen: Observations, kind: Terrain) -> Ground | None:
    """Return the ground under a path in the world, or None if no plane lies there.

    Args:
        path: Poses of the frames, upright to some 20 degrees.
        points: (L, 3) landmarks.
        seen: Which frames see which of them.
        kind: What the ground may be.
    """
    found = []
    for stretch, landmarks in _stretches(path, seen):
        middle = int(stretch[len(stretch) // 2])
        level = _level_line(path.world_T_camera[stretch, :3, 3], points[landmarks], kind)
        if level is not None:
            found.append((middle, path.world_T_camera[middle, :3, :3].T @ level))
    if not found:
        return None
    frame, camera_level = (np.array(column) for column in zip(*found, strict=True))
    elevation = np.einsum("si,si->s", path.world_T_camera[frame, 2, :3], camera_level)
    off = np.abs(elevation - np.median(elevation))
    spread = _MAD * float(np.median(off))
    agree = off <= 3.0 * max(spread, kind.slope_sigma_rad)
    number = int(agree.sum())
    sigma_rad = np.hypot(kind.slope_sigma_rad * np.sqrt(number), spread)  # all of a road falls to one side
    return Ground(frame[agree], camera_level[agree], np.full(number, sigma_rad))


def _stretches(path: Trajectory, seen: Observations) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield the frames of every stretch of the path, and the landmarks that they see."""
    centres, elsewhere = path.world_T_camera[:, :3, 3], np.diff(path.t_s) > _LONGEST_STEP_S
    steps = np.where(elsewhere, _STRETCH_M, np.linalg.norm(np.diff(centres, axis=0), axis=1))
    stretch = np.concatenate([[0.0], np.cumsum(steps)]) // _STRETCH_M
    order = np.argsort(seen.frame, kind="stable")
    frame, landmark = seen.frame[order], seen.landmark[order]
    begins = np.flatnonzero(np.diff(stretch, prepend=-1.0))
    for begin, end in pairwise([*begins.tolist(), len(centres)]):
        rows = slice(*np.searchsorted(frame, [begin, end]))
        yield np.arange(begin, end), distinct(landmark[rows])


class _Section(NamedTuple):
    """Landmarks (n,) relative to the middle of a stretch, metres: to the right, down, and along the path."""

    right: FloatArray
    down: FloatArray
    along: FloatArray

    def near(self, height: FloatArray | float) -> BoolArray:
        """Return which landmarks are near the path for a camera of this height, or of heights (K, 1)."""
        beside, along = np.abs(self.right), np.abs(self.along)
        return np.asarray((beside < _HALF_WIDTH * height) & (along < _HALF_LENGTH * height))


def _level_line(centres: FloatArray, points: FloatArray, kind: Terrain) -> FloatArray | None:
    """Return the direction (3,) in the world of the ground square to a stretch of the path, to the right.

    Args:
        centres: (F, 3) positions of the camera on the stretch.
        points: (L, 3) landmarks seen from there.
        kind: What the ground may be.
    """
    forward = centres[-1] - centres[0]
    length = np.hypot(forward[0], forward[1])
    if length < 0.5 * _STRETCH_M:
        return None
    right = np.array([forward[1], -forward[0], 0.0]) / length
    down = np.cross(forward, right) / np.linalg.norm(forward)
    relative = points - centres[len(centres) // 2]
    section = _Section(relative @ right, relative @ down, relative @ np.cross(right, down))
    slope = _sideways_slope(_Section(*(part[section.down > 0.0] for part in section)), kind)
    if slope is None:
        return None
    return np.asarray((right + slope * down) / np.hypot(1.0, slope))


def _sideways_slope(section: _Section, kind: Terrain) -> float | None:
    """Return the slope down to the right of the plane under the path; None if there is none."""
    if len(section.right) < _MIN_LANDMARKS:
        return None
    a, b = np.random.default_rng(0).integers(0, len(section.right), (2, _TRIALS))
    a, b = a[section.right[a] != section.right[b]], b[section.right[a] != section.right[b]]
    slope = (section.down[b] - section.down[a]) / (section.right[b] - section.right[a])
    height = section.down[a] - slope * section.right[a]
    possible = (np.abs(slope) < _STEEPEST) & (height > 0.0) & (height < kind.highest_m)
    if not possible.any():
        return None
    slope, height = slope[possible, None], height[possible, None]
    deeper = (section.down - slope * section.right) / height - 1.0
    near = section.near(height)
    on, below = near & (np.abs(deeper) < _TOLERANCE), near & (deeper > _TOLERANCE)
    votes = on.sum(axis=1) - _BELOW * below.sum(axis=1)
    best = int(np.argmax(votes))
    if votes[best] < _MIN_LANDMARKS:
        return None
    return _refined(section, float(slope[best, 0]), float(height[best, 0]), kind.min_spread)


def _refined(section: _Section, slope: float, height: float, min_spread: float) -> float | None:
    """Return the slope of the plane by least squares over the landmarks on it; None if it is not held."""
    for _ in range(5):
        off = section.down - slope * section.right - height
        on = section.near(height) & (np.abs(off) < _TOLERANCE * height)
        if on.sum() < _MIN_LANDMARKS or np.std(section.right[on]) < min_spread * height:
            return None
        slope, height = np.polyfit(section.right[on], section.down[on], 1).tolist()
    return float(slope)

"""Places along a live path: a bounded number of described views, and where the path passed them."""

from dataclasses import dataclass

import numpy as np

from vgps.config.loops import LoopsConfig
from vgps.landmarks.descriptors import Descriptors
from vgps.model import FloatArray, IntArray
from vgps.places.words import WordIndex


@dataclass(frozen=True, kw_only=True)
class Sight:
    """A described frame.

    Attributes:
        frame: Its number.
        travelled_m: Distance along the path.
        depth_m: Median depth of its landmarks.
        uv_px: (N, 2) undistorted pixels of its features.
        descriptors: (N, 32) of them.
    """

    frame: int
    travelled_m: float
    depth_m: float
    uv_px: FloatArray
    descriptors: Descriptors


@dataclass(frozen=True, kw_only=True)
class WorldPath:
    """Frames of a path with what is known of them in the world.

    Attributes:
        first_frame: Number of the first.
        poses: (n, 4, 4) world_T_camera.
        scale: (n,) metres per unit of the map.
        covariance: (n, 7, 7) of position, log scale and rotation.
    """

    first_frame: int
    poses: FloatArray
    scale: FloatArray
    covariance: FloatArray

    @property
    def sigma_m(self) -> float:
        """The largest standard deviation of the last position."""
        return float(np.sqrt(np.diagonal(self.covariance[-1])[:3].max()))


class PlaceMemory:
    """The newest places, as many as it may hold, in rows.

    Args:
        capacity: Number of places; beyond it the oldest is forgotten.

    Attributes:
        frame: (capacity,) numbers of their frames; -1 where there is none.
        pose: (capacity, 4, 4) world_T_camera, NaN until it is known.
        covariance: (capacity, 7, 7) of position, log scale and rotation.
    """

    def __init__(self, capacity: int) -> None:
        self._index = WordIndex()
        self._features: dict[int, tuple[Descriptors, FloatArray]] = {}
        self.frame: IntArray = np.full(capacity, -1)
        self.pose, self.covariance = np.full((capacity, 4, 4), np.nan), np.zeros((capacity, 7, 7))
        self._scale, self._travelled_m, self._depth_m = np.ones((3, capacity))
        self._count = 0

    def add(self, sight: Sight, rows: IntArray, points: FloatArray) -> None:
        """Add a place.

        Args:
            sight: The frame.
            rows: (n,) its features of known depth.
            points: (n, 3) their positions in the camera's frame, in units of the map.
        """
        row, self._count = self._count % len(self.frame), self._count + 1
        if self.frame[row] >= 0:
            self._index.discard(int(self.frame[row]))
            del self._features[row]
        descriptors = sight.descriptors[rows]
        self._features[row] = descriptors, points.astype(np.float32)
        self._index.add(sight.frame, self._index.words(descriptors))
        self.frame[row], self.pose[row] = sight.frame, np.nan
        self._travelled_m[row], self._depth_m[row] = sight.travelled_m, sight.depth_m

    def update(self, path: WorldPath) -> None:
        """Put the places along a path where it lies now."""
        at = self.frame - path.first_frame
        rows = np.flatnonzero((at >= 0) & (at < len(path.poses)) & (self.frame >= 0))
        self.pose[rows], self._scale[rows] = path.poses[at[rows]], path.scale[at[rows]]
        self.covariance[rows] = path.covariance[at[rows]]

    def near(self, sight: Sight, path: WorldPath, config: LoopsConfig) -> IntArray:
        """Return the places (n,) of earlier visits that the end of a path may be near, the nearest first."""
        pose = path.poses[-1]
        distance = np.linalg.norm(self.pose[:, :3, 3] - pose[:3, 3], axis=1)
        near = distance < config.reach * sight.depth_m + config.path_sigmas * self.sigma_m(path)
        aligned = self.pose[:, :3, 2] @ pose[:3, 2] > np.cos(np.radians(config.max_angle_deg))
        between = sight.travelled_m - self._travelled_m
        apart = between > config.apart * np.maximum(self._depth_m, sight.depth_m)
        rows = np.flatnonzero(near & aligned & apart)
        return np.asarray(rows[np.argsort(distance[rows], kind="stable")])

    def candidates(self, sight: Sight, near: IntArray, count: int) -> IntArray:
        """Return the places to compare a frame with: the first of ``near`` and the most alike of the rest."""
        words = self._index.words(sight.descriptors)
        return np.asarray(near[self._index.candidates(words, self.frame[near], count)])

    def sigma_m(self, path: WorldPath) -> FloatArray:
        """Return the standard deviations (capacity,) of the places and of the end of a path together."""
        own = np.diagonal(self.covariance, axis1=1, axis2=2)[:, :3].max(axis=1)
        return np.asarray(np.hypot(np.sqrt(own), path.sigma_m))

    def features(self, row: int) -> tuple[Descriptors, FloatArray]:
        """Return the descriptors (n, 32) of a place, and their positions (n, 3) in the world."""
        descriptors, points = self._features[row]
        pose = self.pose[row]
        return descriptors, self._scale[row] * points @ pose[:3, :3].T + pose[:3, 3]

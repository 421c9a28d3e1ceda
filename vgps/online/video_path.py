"""The path of a map as the video alone gives it."""

from dataclasses import dataclass

import numpy as np

from vgps.geometry import interpolate_poses, travelled
from vgps.model import BoolArray, FloatArray

_AROUND_FRAMES = 15  # before and after a frame whose scale is taken


@dataclass(frozen=True, kw_only=True)
class VideoPath:
    """Path of a map as the video alone gives it.

    Attributes:
        t_s: (n,) times of the frames.
        poses: (n, 4, 4) map_T_camera.
        moving: (n,) whether the camera moved since the frame before; during a stop nothing drifts.
    """

    t_s: FloatArray
    poses: FloatArray
    moving: BoolArray

    def at(self, t_s: FloatArray) -> FloatArray:
        """Return the poses (N, 4, 4) at times (N,); those outside the path are clamped."""
        if not len(t_s):
            return np.zeros((0, 4, 4))
        # of many frames few are asked for, mostly the newest
        first = int(np.searchsorted(self.t_s, t_s.min(), side="right")) - 1
        first = min(max(first, 0), len(self.t_s) - 2)
        rows = slice(first, max(int(np.searchsorted(self.t_s, t_s.max())) + 1, first + 2))
        return interpolate_poses(self.t_s[rows], self.poses[rows], t_s)

    def since(self, t_s: float) -> "VideoPath":
        """Return the path from a time within it on."""
        first = int(np.searchsorted(self.t_s, t_s, side="right"))
        begin = np.array([max(t_s, self.t_s[0])])
        return VideoPath(
            t_s=np.append(begin, self.t_s[first:]),
            poses=np.concatenate([self.at(begin), self.poses[first:]]),
            moving=np.append(False, self.moving[first:]),
        )


def length_around(poses: FloatArray) -> FloatArray:
    """Return the length (n,) of the path (n, 4, 4) some frames before and after each frame."""
    length, row = travelled(poses[:, :3, 3]), np.arange(len(poses))
    last = np.minimum(row + _AROUND_FRAMES, len(poses) - 1)
    return np.asarray(length[last] - length[np.maximum(row - _AROUND_FRAMES, 0)])

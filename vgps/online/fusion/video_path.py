"""The path of a map as the video alone gives it."""

from dataclasses import dataclass, field, replace

import numpy as np

from vgps.geometry import rotation_matrices, rotation_vectors, travelled
from vgps.mapping.bending import continued
from vgps.mapping.local_map import LocalMap
from vgps.model import BoolArray, FloatArray
from vgps.online.fusion.place_ties import PlaceTies
from vgps.smoothing.alignment.drift_correction import move_frames

_AROUND_FRAMES = 15  # before and after a frame whose scale is taken


@dataclass(frozen=True, kw_only=True)
class VideoPath:
    """Path of a map as the video alone gives it.

    Attributes:
        t_s: (n,) times of the frames.
        poses: (n, 4, 4) map_T_camera.
        moving: (n,) whether the camera moved since the frame before; during a stop nothing drifts.
        bending: (n,) variance, rad^2 about each axis, by which its rotation may err more than at the frame
            before, by stage C; None for none.
        ties: Frames in which it came back to a place.
    """

    t_s: FloatArray
    poses: FloatArray
    moving: BoolArray
    bending: FloatArray | None = None
    ties: PlaceTies = field(default_factory=PlaceTies.none)

    def snapshot(self) -> "VideoPath":
        """Return a copy that stays as it is while the map changes."""
        return replace(self, t_s=self.t_s.copy(), poses=self.poses.copy())

    def bent(self, t_s: FloatArray) -> FloatArray:
        """Return the sum (N,) of the bending up to times (N,)."""
        if self.bending is None:
            return np.zeros(len(t_s))
        return np.interp(t_s, self.t_s, np.cumsum(self.bending))

    def at(self, t_s: FloatArray) -> FloatArray:
        """Return the poses (N, 4, 4) at times (N,); those outside the path are clamped.

        They are those of :func:`vgps.geometry.interpolate_poses`, whose SciPy takes ten times as long for a
        few of them, while the newest pose waits.
        """
        after = np.clip(np.searchsorted(self.t_s, t_s, side="right"), 1, len(self.t_s) - 1)
        before_s, after_s = self.t_s[after - 1], self.t_s[after]
        share = np.clip((t_s - before_s) / (after_s - before_s), 0.0, 1.0)[:, None]
        out, step = self.poses[after - 1].copy(), self.poses[after, :3, 3] - self.poses[after - 1, :3, 3]
        turn = rotation_vectors(out[:, :3, :3].transpose(0, 2, 1) @ self.poses[after, :3, :3])
        out[:, :3, :3] = out[:, :3, :3] @ rotation_matrices(share * turn)
        out[:, :3, 3] += share * step
        return out

    def since(self, t_s: float) -> "VideoPath":
        """Return the path from a time within it on."""
        first = int(np.searchsorted(self.t_s, t_s, side="right"))
        begin = np.array([max(t_s, self.t_s[0])])
        return VideoPath(
            t_s=np.append(begin, self.t_s[first:]),
            poses=np.concatenate([self.at(begin), self.poses[first:]]),
            moving=np.append(False, self.moving[first:]),
            bending=None if self.bending is None else np.append(0.0, self.bending[first:]),
            ties=self.ties.where(self.ties.t_s >= begin[0]),
        )


def path_of(current: LocalMap, keep_s: float, ties: PlaceTies) -> VideoPath:
    """Return the path of a map over the last ``keep_s``, with the ties of this time."""
    since_s = max(current.t_s[-1] - keep_s, current.t_s[0])
    first = max(current.first_posed - current.first_frame, int(np.searchsorted(current.t_s, since_s)))
    moving = current.moving[first:]
    return VideoPath(
        t_s=current.t_s[first:],
        poses=current.poses[first:],
        moving=moving,
        bending=moving * continued(current.bending)[first:],
        ties=ties.where(ties.t_s >= current.t_s[first]),
    )


def move_map(current: LocalMap, world_T_camera: FloatArray) -> None:
    """Move a map with its poses to where all frames (F, 4, 4) lie; not if one of its own is unknown."""
    moved = world_T_camera[current.first_posed : current.next_frame]
    if np.isfinite(moved[:, 0, 0]).all():
        scale = length_around(moved) / np.maximum(length_around(current.poses[-len(moved) :]), 1e-9)
        current.apply(move_frames(current, moved, scale))


def length_around(poses: FloatArray) -> FloatArray:
    """Return the length (n,) of the path (n, 4, 4) some frames before and after each frame."""
    length, row = travelled(poses[:, :3, 3]), np.arange(len(poses))
    last = np.minimum(row + _AROUND_FRAMES, len(poses) - 1)
    return np.asarray(length[last] - length[np.maximum(row - _AROUND_FRAMES, 0)])

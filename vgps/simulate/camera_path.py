"""A given path of a camera, levelled to stand above flat ground."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from vgps.errors import TrajectoryError
from vgps.model import FloatArray
from vgps.readers.kitti_poses import read_kitti_poses

# axes (x right, y down, z forward) of an upright camera that looks east
EAST_R_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])

_HILL_S = 2.0  # slower changes of height and tilt are hills, quicker ones the vehicle's own motion
_FEWEST = 10


@dataclass(frozen=True)
class CameraPath:
    """Poses at an even rate, of a camera that first looked east.

    Attributes:
        rate_hz: Poses per second.
        horizontal: (N, 3) east, north [m] and yaw [rad], without jumps of a turn.
        own_motion: (N, 3) height above the mean [m], pitch and roll [rad] of the vehicle's own motion.
        streets: (S, 3) as ``horizontal``, the whole path of which this one may be a part; streets line it.
    """

    rate_hz: float
    horizontal: FloatArray
    own_motion: FloatArray
    streets: FloatArray

    @property
    def duration_s(self) -> float:
        """Time of the pose that would follow the last one."""
        return len(self.horizontal) / self.rate_hz

    @property
    def speed_m_s(self) -> float:
        """Mean speed."""
        steps = np.linalg.norm(np.diff(self.horizontal[:, :2], axis=0), axis=1)
        return float(steps.mean() * self.rate_hz)

    def extended(self, margin_s: float) -> tuple[FloatArray, FloatArray]:
        """Return times (n,) and east, north, up, yaw, pitch, roll (n, 6), continued at both ends."""
        more = int(np.ceil(margin_s * self.rate_hz))
        steps = np.arange(1, more + 1)[:, None]
        first, last = self.horizontal[0], self.horizontal[-1]
        before = first - steps[::-1] * (self.horizontal[1] - first)
        after = last + steps * (last - self.horizontal[-2])
        own = np.pad(self.own_motion, ((more, more), (0, 0)), mode="edge")
        t_s = np.arange(-more, len(self.horizontal) + more) / self.rate_hz
        east, north, yaw = np.concatenate([before, self.horizontal, after]).T
        up, pitch, roll = own.T
        return t_s, np.stack([east, north, up, yaw, pitch, roll], axis=-1)


def read_camera_path(
    path: Path, rate_hz: float = 10.0, first: int = 0, count: int | None = None
) -> CameraPath:
    """Read a path from poses as KITTI writes them, and take its hills out.

    Args:
        path: File of poses.
        rate_hz: Poses per second.
        first, count: The part to use; by default all. The streets are those of the whole path, so that
            recordings of different parts are of one world.

    Raises:
        TrajectoryError: The file cannot be read, or too few poses are left.
    """
    poses = read_kitti_poses(path)
    part = slice(first, None if count is None else first + count)
    left = len(poses[part])
    if left < _FEWEST:
        raise TrajectoryError(
            f"{left} poses from pose {first} on, of {len(poses)}",
            file=path,
            expected=f"at least {_FEWEST}",
            remedy="choose another part with --first-pose and --poses",
        )
    return level_path(poses, rate_hz, part)


def level_path(world_T_camera: FloatArray, rate_hz: float, part: slice = slice(None)) -> CameraPath:
    """Return the path of poses (N, 4, 4) whose world is that of a level camera, x right, y down, z forward.

    A flat ground has no hills: slow changes of height, pitch and roll are taken out.
    """
    p = world_T_camera[:, :3, 3] @ EAST_R_CAMERA.T
    R = EAST_R_CAMERA @ world_T_camera[:, :3, :3]
    ahead, right = R[:, :, 2], R[:, :, 0]
    yaw = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    pitch = np.arcsin(np.clip(ahead[:, 2], -1.0, 1.0))
    level = np.stack([np.sin(yaw), -np.cos(yaw), np.zeros_like(yaw)], axis=-1)  # to the right, horizontally
    roll = np.arctan2(-right[:, 2] / np.cos(pitch), np.sum(right * level, axis=1))
    own = np.stack([p[:, 2], pitch, roll], axis=-1)
    own -= gaussian_filter1d(own, _HILL_S * rate_hz, axis=0, mode="nearest")
    horizontal = np.column_stack([p[:, :2], yaw])
    return CameraPath(rate_hz, horizontal[part], own[part], horizontal)

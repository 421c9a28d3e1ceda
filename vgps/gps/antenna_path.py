"""The antenna along a path of the camera: where it was at the times of fixes, and how fast it moved."""

from dataclasses import dataclass

import numpy as np

from vgps.gps.fixes import Fixes
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Trajectory

_MEAN_S, _MEAN_OF = 0.5, 8  # duration of the means beside a fix, and how many places they are of


@dataclass(frozen=True)
class Placement:
    """Times of fixes relative to the frames around them.

    Attributes:
        frame: (M,) frame before each fix.
        alpha: (M,) fraction of the interval to the next frame, in [0, 1].
        inside: (M,) whether the fix is within the video.
    """

    frame: IntArray
    alpha: FloatArray
    inside: BoolArray


def place(frame_t_s: FloatArray, fix_t_s: FloatArray, beyond: bool = False) -> Placement:
    """Return the frames around each fix and the fraction of the interval between them.

    Args:
        frame_t_s: (F,) strictly increasing, F >= 2.
        fix_t_s: (M,) times of the fixes.
        beyond: Whether alpha extrapolates, leaving [0, 1], for fixes outside the video; else it is clipped.
    """
    frame = np.clip(np.searchsorted(frame_t_s, fix_t_s, side="right") - 1, 0, len(frame_t_s) - 2)
    alpha = (fix_t_s - frame_t_s[frame]) / (frame_t_s[frame + 1] - frame_t_s[frame])
    inside = (alpha >= 0.0) & (alpha <= 1.0)
    return Placement(frame, alpha if beyond else np.clip(alpha, 0.0, 1.0), inside)


def antenna_at(poses: FloatArray, placement: Placement, camera_p_antenna: FloatArray) -> FloatArray:
    """Return the antenna (M, 3) in the world at the fixes' times by linear interpolation between frames.

    Over one frame interval it differs from interpolation on SE(3) only by the sagitta of the arc.

    Args:
        poses: (F, 4, 4) world_T_camera.
        placement: Times of the fixes relative to these frames.
        camera_p_antenna: (3,) metres.
    """
    antenna = poses[:, :3, :3] @ camera_p_antenna + poses[:, :3, 3]
    alpha = placement.alpha[:, None]
    return np.asarray((1.0 - alpha) * antenna[placement.frame] + alpha * antenna[placement.frame + 1])


def antenna_offsets(fixes: Fixes, path: Trajectory, camera_p_antenna: FloatArray) -> FloatArray:
    """Return antenna minus fix (M, 3); where a fix is before or after the path, at its end."""
    return antenna_at(path.world_T_camera, place(path.t_s, fixes.t_s), camera_p_antenna) - fixes.world_p_fix


def antenna_velocities(path: Trajectory, t_s: FloatArray, camera_p_antenna: FloatArray) -> FloatArray:
    """Return the velocity of the antenna (M, 3) by its mean places in half a second before and after, m/s.

    From frame to frame the noise of the poses is as large as changes of speed. Taken for velocity, it makes
    accurate fixes contradict every other time offset, so that many of them seem to know it too well. A mean
    velocity over a second has little of it, too, but the bob of a walk, two steps a second, reversed.

    Args:
        path: The frames.
        t_s: (M,) times.
        camera_p_antenna: (3,) metres.
    """
    begin_s, end_s = path.t_s[[0, -1]]
    away_s = _MEAN_S * (np.arange(_MEAN_OF) + 0.5) / _MEAN_OF
    within_s = np.clip(t_s, begin_s, end_s)
    at_s = np.clip(np.add.outer([-away_s, away_s], within_s), begin_s, end_s)  # (2, n, M)
    places = antenna_at(path.world_T_camera, place(path.t_s, at_s.ravel()), camera_p_antenna)
    moved = np.diff(places.reshape(*at_s.shape, 3).mean(axis=1), axis=0)[0]
    return np.asarray(moved / np.diff(at_s.mean(axis=1), axis=0).T)

"""Which way is up in the map, by an IMU: specific force minus the acceleration that the video shows.

``f = a - g``: over a window of a second or two the mean of the specific force, turned into the map's axes,
minus the change of the video's velocity over the window is 9.8 m/s^2 upwards. What remains is the bias of the
accelerometer, which tilts the camera's axes by the same angles wherever it goes: two unknowns of the fusion.
"""

from dataclasses import dataclass, replace

import numpy as np

from vgps.config import ImuConfig
from vgps.geometry import interpolate_vectors
from vgps.imu.camera_imu import CameraImu
from vgps.model import BoolArray, FloatArray
from vgps.online.fusion.fusion_nodes import FusionNodes
from vgps.online.fusion.video_path import VideoPath

_WINDOW_S, _SHORTEST_S = 1.5, 0.5
_HALF_S = 0.15  # a velocity is a difference of positions so long before and after
# Error of a velocity by the video: of positions to a centimetre or two, and of the scale while it drifts.
_VELOCITY_SIGMA_M_S, _VELOCITY_SHARE = 0.05, 0.05


@dataclass(frozen=True)
class UpInMap:
    """The vertical at times (N,): unit vectors (N, 3) in the map's axes, and their errors (N,) [rad].

    Without samples the error is infinite.
    """

    direction: FloatArray
    sigma_rad: FloatArray


class Gravity:
    """The vertical by an IMU.

    Args:
        imu: Samples at the camera; those after the end of a path do not count.
        config: Errors of the accelerometer.
    """

    def __init__(self, imu: CameraImu, config: ImuConfig) -> None:
        self._imu = imu
        self.bias_rad = config.accelerometer_bias_sigma / imu.gravity_m_s2
        between = 0.5 * (imu.force_m_s2[1:] + imu.force_m_s2[:-1]) * np.diff(imu.t_s)[:, None]
        self._sum = np.concatenate([np.zeros((1, 3)), np.cumsum(between, axis=0)])

    def up(self, path: VideoPath, t_s: FloatArray, scale: FloatArray) -> UpInMap:
        """Return the vertical in the window before each time.

        Args:
            path: At least two frames.
            t_s: (N,) times within it.
            scale: (N,) metres per unit of the map.
        """
        end_s = np.minimum(t_s, path.t_s[-1]) - _HALF_S
        start_s = np.maximum(end_s - _WINDOW_S, path.t_s[0] + _HALF_S)
        span_s = end_s - start_s
        known = (span_s >= _SHORTEST_S) & self._imu.covers(start_s, end_s)
        span_s = np.where(known, span_s, 1.0)
        integral = self._force_in_map(path)
        force = interpolate_vectors(path.t_s, integral, end_s)
        force -= interpolate_vectors(path.t_s, integral, start_s)
        change = scale[:, None] * (_velocity(path, end_s, known) - _velocity(path, start_s, known))
        up = (force - change) / span_s[:, None]
        length = np.maximum(np.linalg.norm(up, axis=1), 1e-9)
        moved = np.hypot(_VELOCITY_SIGMA_M_S, _VELOCITY_SHARE * np.linalg.norm(change, axis=1)) / span_s
        sigma = np.hypot(moved, self._imu.accelerometer_density / np.sqrt(span_s)) / self._imu.gravity_m_s2
        return UpInMap(up / length[:, None], np.where(known, sigma, np.inf))

    def levelled(self, nodes: FusionNodes, path: VideoPath, scale: FloatArray) -> FusionNodes:
        """Return nodes (N,) with the elevations of the camera's axes, each for the time since the one before.

        Args:
            nodes: Those of the path.
            path: At least two frames.
            scale: (N,) metres per unit of the map.
        """
        up = self.up(path, nodes.t_s, scale)
        share = np.minimum(np.diff(nodes.t_s, prepend=nodes.t_s[0]) / _WINDOW_S, 1.0)
        level = np.sqrt(share) / up.sigma_rad
        return replace(
            nodes,
            elevation=np.einsum("ni,nij->nj", up.direction, nodes.axes),
            level=np.stack([level, level], axis=1),
            mean_roll=np.inf,
        )

    def _force_in_map(self, path: VideoPath) -> FloatArray:
        """Return the integral (n, 3) of the specific force in the map's axes since the path's first frame."""
        at_frames = interpolate_vectors(self._imu.t_s, self._sum, path.t_s)
        R = path.poses[:, :3, :3]
        steps = 0.5 * (R[1:] + R[:-1]) @ np.diff(at_frames, axis=0)[:, :, None]
        return np.concatenate([np.zeros((1, 3)), np.cumsum(steps[:, :, 0], axis=0)])


def _velocity(path: VideoPath, t_s: FloatArray, known: BoolArray) -> FloatArray:
    """Return the velocity (N, 3) in the map at times (N,); zero where it is not asked for."""
    inside = np.where(known, t_s, 0.5 * (path.t_s[0] + path.t_s[-1]))
    centres = path.poses[:, :3, 3]
    before, after = (interpolate_vectors(path.t_s, centres, inside + d_s) for d_s in (-_HALF_S, _HALF_S))
    return np.where(known[:, None], (after - before) / (2.0 * _HALF_S), 0.0)

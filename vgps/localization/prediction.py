"""Prediction of the camera's pose and of its landmarks' image motion: (A), (C) and Eq. (6), Matsuda 2007."""

from dataclasses import dataclass, field
from functools import lru_cache, reduce

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.model import FloatArray


def _zero() -> FloatArray:
    return np.zeros(3)


@dataclass(frozen=True, kw_only=True)
class MotionState:
    """State of the camera from which later poses are predicted.

    Attributes:
        t_s: Time of the state.
        world_T_camera: (4, 4).
        world_v_camera: (3,) velocity of the camera's centre, m/s; None while unknown.
        camera_w_rad_s: (3,) angular rate in the camera's axes, used where there is no gyro.
        gyro_bias_rad_s: (3,) in the gyro's axes.
    """

    t_s: float
    world_T_camera: FloatArray
    world_v_camera: FloatArray | None = None
    camera_w_rad_s: FloatArray = field(default_factory=_zero)
    gyro_bias_rad_s: FloatArray = field(default_factory=_zero)


class RotationPredictor:
    """Relative rotations of the camera, from the gyro where it covers them, else at constant angular rate.

    Args:
        gyro: Integral of the gyro's rates; None without a usable gyro.
        gyro_R_camera: (3, 3).

    Attributes:
        covers: Whether the gyro covers the whole interval between two times, s.
    """

    def __init__(self, gyro: GyroIntegral | None, gyro_R_camera: FloatArray | None) -> None:
        self._gyro = gyro if gyro_R_camera is not None else None
        self._mount = np.eye(3) if gyro_R_camera is None else gyro_R_camera
        # every search in a frame needs the same few rotations
        self._gyro_rotation = lru_cache(maxsize=32)(self._integrate)
        self.covers = lru_cache(maxsize=32)(self._covers)

    def _covers(self, start_s: float, end_s: float) -> bool:
        first, last = np.array([min(start_s, end_s)]), np.array([max(start_s, end_s)])
        return self._gyro is not None and bool(self._gyro.covers(first, last)[0])

    def relative_rotation(self, motion: MotionState, start_s: float, end_s: float) -> FloatArray:
        """Return start_R_end (3, 3) of the camera, Eq. (1), Matsuda 2007; the end may precede the start.

        The paper's Eq. (3) is a skew matrix of rates; here every sample goes through the exponential.
        """
        if not self.covers(start_s, end_s):
            rotation = Rotation.from_rotvec(motion.camera_w_rad_s * (end_s - start_s)).as_matrix()
            return np.asarray(rotation, np.float64)
        bias = tuple(motion.gyro_bias_rad_s)
        rotation = self._gyro_rotation(min(start_s, end_s), max(start_s, end_s), bias)
        return rotation if end_s >= start_s else rotation.T

    def _integrate(self, start_s: float, end_s: float, bias_rad_s: tuple[float, ...]) -> FloatArray:
        assert self._gyro is not None
        if end_s <= start_s:
            return np.eye(3)
        rates, dts = self._gyro.steps(start_s, end_s)
        # one call for all steps: for a few small rotations SciPy's overhead is most of the cost
        steps = Rotation.from_rotvec((rates - np.array(bias_rad_s)) * dts[:, None]).as_matrix()
        return np.asarray(self._mount.T @ reduce(np.matmul, steps) @ self._mount)


def predict_pose(motion: MotionState, rotations: RotationPredictor, t_s: float) -> FloatArray:
    """Return the pose (4, 4) at a time: rotation by the gyro, centre at constant velocity.

    Eq. (1) and (5), Matsuda 2007. The paper extrapolates the translation of world to camera, which is wrong
    while the camera rotates; the centre is meant.
    """
    pose = motion.world_T_camera.copy()
    pose[:3, :3] = pose[:3, :3] @ rotations.relative_rotation(motion, motion.t_s, t_s)
    if motion.world_v_camera is not None:
        pose[:3, 3] = pose[:3, 3] + motion.world_v_camera * (t_s - motion.t_s)
    return pose


def exposure_motion_px(
    K: FloatArray,
    motion: MotionState,
    rotations: RotationPredictor,
    t_s: float,
    exposure_s: float,
    points: FloatArray,
) -> FloatArray:
    """Return the image motion (N, 2) of landmarks (N, 3) during an exposure centred on ``t_s``."""
    start, _ = project(K, predict_pose(motion, rotations, t_s - exposure_s / 2), points)
    end, _ = project(K, predict_pose(motion, rotations, t_s + exposure_s / 2), points)
    return end - start


def interval_motion_px(
    K: FloatArray, last: FloatArray, predicted: FloatArray, share: float, points: FloatArray
) -> FloatArray:
    """Return the blur (N, 2) as in (C), Matsuda 2007: ``b = (c_{i-1} - c~_i) exposure/interval``.

    Args:
        K: (3, 3).
        last, predicted: (4, 4) pose of the last frame, and the one predicted for this.
        share: Exposure over frame interval.
        points: (N, 3) landmarks, world.
    """
    return (project(K, last, points)[0] - project(K, predicted, points)[0]) * share


def search_radius_px(
    focal_px: float, depth_m: FloatArray, speed_m_s: float, dt_s: float, slack_px: float
) -> FloatArray:
    """Return half sides (N,) of the windows, Eq. (6), Matsuda 2007: ``f V_max dt / depth + delta'``.

    The paper omits the focal length. ``speed_m_s`` is the largest deviation from the predicted velocity.
    """
    return np.asarray(focal_px * speed_m_s * dt_s / depth_m + slack_px)

"""Where the camera will be, and where its landmarks: (A), (B) and Eq. (6) of Matsuda 2007."""

from dataclasses import dataclass
from functools import lru_cache, reduce

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.model import FloatArray


@dataclass(frozen=True)
class MotionState:
    """What is known of the camera at a time.

    Attributes:
        t_s: The time.
        world_T_camera: (4, 4).
        world_v_camera: (3,) velocity of the camera's centre [m/s]; None while it is not known.
        camera_w_rad_s: (3,) turn rate in the camera's axes, for want of a gyro.
        gyro_bias_rad_s: (3,) in the gyro's axes.
    """

    t_s: float
    world_T_camera: FloatArray
    world_v_camera: FloatArray | None
    camera_w_rad_s: FloatArray
    gyro_bias_rad_s: FloatArray


class RotationPredictor:
    """Rotations of the camera between times, from the gyro where it covers them, else from the last rate.

    Args:
        gyro: Integral of the gyro's rates, if there is one that may be used.
        gyro_R_camera: (3, 3).

    Attributes:
        covers: Whether the gyro tells of the whole interval between two times [s].
    """

    def __init__(self, gyro: GyroIntegral | None, gyro_R_camera: FloatArray | None) -> None:
        self._gyro = gyro if gyro_R_camera is not None else None
        self._mount = np.eye(3) if gyro_R_camera is None else gyro_R_camera
        # every search of a frame asks for the same few turns
        self._gyro_turn = lru_cache(maxsize=32)(self._integrated)
        self.covers = lru_cache(maxsize=32)(self._covers)

    def _covers(self, start_s: float, end_s: float) -> bool:
        first, last = np.array([min(start_s, end_s)]), np.array([max(start_s, end_s)])
        return self._gyro is not None and bool(self._gyro.covers(first, last)[0])

    def relative_rotation(self, motion: MotionState, start_s: float, end_s: float) -> FloatArray:
        """Rotation (3, 3) start_R_end of the camera, Eq. (1), Matsuda 2007; the end may lie before the start.

        The paper's Eq. (3) has a bare skew matrix of rates; here every sample goes through the exponential.
        """
        if not self.covers(start_s, end_s):
            rotation = Rotation.from_rotvec(motion.camera_w_rad_s * (end_s - start_s)).as_matrix()
            return np.asarray(rotation, np.float64)
        relative_rotation = self._gyro_turn(
            min(start_s, end_s), max(start_s, end_s), tuple(motion.gyro_bias_rad_s)
        )
        return relative_rotation if end_s >= start_s else relative_rotation.T

    def _integrated(self, start_s: float, end_s: float, bias_rad_s: tuple[float, ...]) -> FloatArray:
        assert self._gyro is not None
        if end_s <= start_s:
            return np.eye(3)
        rates, dts = self._gyro.steps(start_s, end_s)
        # one call for all steps: for a few small rotations SciPy's overhead is most of the cost
        steps = Rotation.from_rotvec((rates - np.array(bias_rad_s)) * dts[:, None]).as_matrix()
        return np.asarray(self._mount.T @ reduce(np.matmul, steps) @ self._mount)


def predict(motion: MotionState, rotations: RotationPredictor, t_s: float) -> FloatArray:
    """Pose (4, 4) at a time: rotation from the last estimate and the gyro, centre at constant velocity.

    Eq. (1) and (5), Matsuda 2007. The paper extrapolates the translation of world to camera, which is wrong
    while the camera turns; the centre is meant.
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
    """(N, 2) image motion of landmarks (N, 3) while the shutter is open, ``exposure_s`` about ``t_s``."""
    start, _ = project(K, predict(motion, rotations, t_s - exposure_s / 2), points)
    end, _ = project(K, predict(motion, rotations, t_s + exposure_s / 2), points)
    return end - start


def interval_motion_px(
    K: FloatArray, last: FloatArray, predicted: FloatArray, share: float, points: FloatArray
) -> FloatArray:
    """(N, 2) blur of landmarks (N, 3) as in (C), Matsuda 2007: ``b = (c_{i-1} - c~_i) exposure/interval``.

    Args:
        K: (3, 3).
        last, predicted: (4, 4) pose of the last frame, and the one predicted for this.
        share: Exposure over frame interval.
        points: (N, 3) in the world.
    """
    return (project(K, last, points)[0] - project(K, predicted, points)[0]) * share


def search_radius_px(
    focal_px: float, depth_m: FloatArray, speed_m_s: float, dt_s: float, slack_px: float
) -> FloatArray:
    """(N,) half side of the windows, Eq. (6), Matsuda 2007: ``f V_max dt / depth + delta'``.

    The paper leaves out the focal length. ``speed_m_s`` is the largest by which the camera's velocity departs
    from the one that it was predicted with.
    """
    return np.asarray(focal_px * speed_m_s * dt_s / depth_m + slack_px)

"""(E) frame by frame: the pose is what the frame's own matches say."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import LocalizationConfig
from vgps.localization.pose import PoseEstimate
from vgps.localization.prediction import MotionState
from vgps.localization.search import LandmarkMatches
from vgps.model import FloatArray


class FrameEstimator:
    """Keeps the last pose and the velocity between the last two, Eq. (5), Matsuda 2007.

    Args:
        config: When two poses give a velocity.
    """

    def __init__(self, config: LocalizationConfig) -> None:
        self._config = config
        self._motion: MotionState | None = None

    @property
    def motion(self) -> MotionState | None:
        """As in :class:`vgps.localization.tracker.Estimator`."""
        return self._motion

    def add(self, t_s: float, pose: PoseEstimate, seen: LandmarkMatches, *, anew: bool) -> PoseEstimate:
        """As in :class:`vgps.localization.tracker.Estimator`."""
        self._motion = motion_between(self._motion, t_s, pose.world_T_camera, self._config)
        return PoseEstimate(pose.world_T_camera, pose.covariance, np.ones(len(seen), bool))

    def revised(self) -> dict[float, FloatArray]:
        """Nothing: a pose stays as it was."""
        return {}


def motion_between(
    last: MotionState | None, t_s: float, world_T_camera: FloatArray, config: LocalizationConfig
) -> MotionState:
    """MotionState at a pose from the last one: velocity of the centre, turn rate in the camera's axes.

    Two poses of which one was found anew give it too; only where they lie too far apart for a camera that
    moves at ``config.max_speed_m_s``, or for long, nothing is known of it.
    """
    bias = np.zeros(3) if last is None else last.gyro_bias_rad_s
    if last is None or t_s - last.t_s > config.max_velocity_gap_s:
        return MotionState(t_s, world_T_camera, None, np.zeros(3), bias)
    dt = t_s - last.t_s
    velocity = (world_T_camera[:3, 3] - last.world_T_camera[:3, 3]) / dt
    if np.linalg.norm(velocity) > config.max_speed_m_s:
        return MotionState(t_s, world_T_camera, None, np.zeros(3), bias)
    turn = Rotation.from_matrix(last.world_T_camera[:3, :3].T @ world_T_camera[:3, :3])
    return MotionState(t_s, world_T_camera, velocity, turn.as_rotvec() / dt, last.gyro_bias_rad_s)

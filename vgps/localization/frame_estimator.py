"""(E) frame by frame: the pose is that of the frame's own matches."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.localization.pose import LandmarkMatches, PoseEstimate
from vgps.localization.prediction import MotionState
from vgps.model import FloatArray


class FrameEstimator:
    """Keeps the last pose and the velocity between the last two, Eq. (5), Matsuda 2007.

    Args:
        max_velocity_gap_s: Two frames further apart give no velocity.
    """

    def __init__(self, max_velocity_gap_s: float) -> None:
        self._max_gap_s = max_velocity_gap_s
        self._motion: MotionState | None = None

    @property
    def motion(self) -> MotionState | None:
        """See :class:`vgps.localization.tracker.Estimator`."""
        return self._motion

    def add(self, t_s: float, pose: PoseEstimate, matches: LandmarkMatches, *, restart: bool) -> PoseEstimate:
        """See :class:`vgps.localization.tracker.Estimator`."""
        bias = np.zeros(3) if self._motion is None else self._motion.gyro_bias_rad_s
        self._motion = motion_between(self._motion, t_s, pose.world_T_camera, bias, self._max_gap_s)
        return PoseEstimate(pose.world_T_camera, pose.covariance, np.ones(len(matches), bool))

    def revised(self) -> dict[float, FloatArray]:
        """Return no poses: none is revised."""
        return {}


def motion_between(
    last: MotionState | None,
    t_s: float,
    world_T_camera: FloatArray,
    gyro_bias_rad_s: FloatArray,
    max_gap_s: float,
) -> MotionState:
    """Return the state at a pose, its velocities from the last state.

    They are unknown without a last state and across a long interval. There is no upper limit: a velocity
    from a false pose is refuted by the next frame, which the tracker then searches without it.
    """
    unknown = MotionState(t_s=t_s, world_T_camera=world_T_camera, gyro_bias_rad_s=gyro_bias_rad_s)
    if last is None or t_s - last.t_s > max_gap_s:
        return unknown
    dt = t_s - last.t_s
    velocity = (world_T_camera[:3, 3] - last.world_T_camera[:3, 3]) / dt
    rotation = Rotation.from_matrix(last.world_T_camera[:3, :3].T @ world_T_camera[:3, :3])
    return MotionState(
        t_s=t_s,
        world_T_camera=world_T_camera,
        world_v_camera=velocity,
        camera_w_rad_s=rotation.as_rotvec() / dt,
        gyro_bias_rad_s=gyro_bias_rad_s,
    )

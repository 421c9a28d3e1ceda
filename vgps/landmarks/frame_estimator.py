"""(E) frame by frame: the pose is what the frame's own matches say."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.landmarks.pose import PoseEstimate
from vgps.landmarks.prediction import Motion
from vgps.landmarks.search import Sightings
from vgps.model import FloatArray

_LONGEST_STEP_S = 0.5  # a velocity from frames farther apart is none


class FrameEstimator:
    """Keeps the last pose and the velocity between the last two, Eq. (5), Matsuda 2007."""

    def __init__(self) -> None:
        self._motion: Motion | None = None

    @property
    def motion(self) -> Motion | None:
        """As in :class:`vgps.landmarks.tracker.Estimator`."""
        return self._motion

    def add(self, t_s: float, pose: PoseEstimate, seen: Sightings, *, anew: bool) -> PoseEstimate:
        """As in :class:`vgps.landmarks.tracker.Estimator`."""
        last = None if anew else self._motion
        self._motion = motion_between(last, t_s, pose.world_T_camera)
        return PoseEstimate(pose.world_T_camera, pose.covariance, np.ones(len(seen), bool))

    def revised(self) -> dict[float, FloatArray]:
        """Nothing: a pose stays as it was."""
        return {}


def motion_between(last: Motion | None, t_s: float, world_T_camera: FloatArray) -> Motion:
    """Motion at a pose from the last one: velocity of the centre, turn rate in the camera's axes."""
    if last is None or t_s - last.t_s > _LONGEST_STEP_S:
        return Motion(t_s, world_T_camera, None, np.zeros(3), np.zeros(3))
    dt = t_s - last.t_s
    velocity = (world_T_camera[:3, 3] - last.world_T_camera[:3, 3]) / dt
    turn = Rotation.from_matrix(last.world_T_camera[:3, :3].T @ world_T_camera[:3, :3])
    return Motion(t_s, world_T_camera, velocity, turn.as_rotvec() / dt, last.gyro_bias_rad_s)

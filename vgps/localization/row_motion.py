"""Where the rows of a rolling shutter show landmarks, by the camera's motion during the readout.

The camera's poses at a few times of the readout, rotated by the gyro, are knots of the path through which
stages A, C and D see rows too (:mod:`factors.continuous_path`).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from factors import poses_at
from vgps.camera import row_shares
from vgps.geometry import project, rays
from vgps.localization.frame_estimator import motion_between
from vgps.localization.prediction import MotionState, RotationPredictor, predict_pose
from vgps.model import Camera, FloatArray
from vgps.tracking.row_motion import row_shifts

_KNOTS = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])  # shares of the readout

AtMiddleRow = Callable[[FloatArray], FloatArray]
"""Where pixels (N, 2) would be at the time of the frame, that of its middle row."""


class RowMotion:
    """Undoes a rolling shutter: rows of a frame are brought to the time of its middle row.

    Args:
        camera: Its readout; nothing is to be undone if it is zero or unknown.
        rotations: Of the camera between two times.
        max_gap_s: Two frames further apart give no velocity.
    """

    def __init__(self, camera: Camera, rotations: RotationPredictor, max_gap_s: float) -> None:
        self._camera, self._rotations, self._max_gap_s = camera, rotations, max_gap_s
        self._knot_s = np.sort(_KNOTS * (camera.readout_s or 0.0))

    def shifts_px(self, t_s: float, motion: MotionState, pose: FloatArray, points: FloatArray) -> FloatArray:
        """Return how far landmarks (N, 3) are seen from where a pose (4, 4) of the middle row shows them.

        Args:
            t_s: Time of the frame.
            motion: State before it, or at its time.
            pose: Of the frame.
            points: The landmarks.

        Returns:
            (N, 2) undistorted pixels.
        """
        if not self._camera.readout_s:
            return np.zeros((len(points), 2))
        state = replace(motion, world_T_camera=pose)
        if t_s > motion.t_s:
            state = motion_between(motion, t_s, pose, motion.gyro_bias_rad_s, self._max_gap_s)
        return row_shifts(self._camera, self._knot_s, self._poses(state), pose, points)

    def at_middle_row(self, motion: MotionState, uv_px: FloatArray) -> FloatArray:
        """Return pixels (N, 2) as the middle row's orientation shows them, whatever their depth.

        Args:
            motion: State at the frame's time, of which only what gives its rotation is used.
            uv_px: Undistorted pixels as seen.
        """
        if not self._camera.readout_s:
            return uv_px
        still = replace(motion, world_T_camera=np.eye(4), world_v_camera=None)
        at_s = self._camera.readout_s * row_shares(self._camera, uv_px)
        turned = poses_at(self._knot_s, self._poses(still), at_s)[:, :3, :3]
        directions = np.einsum("nij,nj->ni", turned, rays(self._camera.K, uv_px))
        return project(self._camera.K, np.eye(4), directions)[0]

    def _poses(self, state: MotionState) -> FloatArray:
        at_s = (state.t_s + self._knot_s).tolist()
        return np.stack([predict_pose(state, self._rotations, t) for t in at_s])

"""A weak prior that the camera is level, for rotations that no other factor determines."""

import gtsam
import numpy as np

from factors.custom import POSE3, Linearisation, Variable, custom_factor

_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # camera x (right) and z (forward)
_SKEW = np.array([[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0]]], dtype=np.float64)


def level_factor(pose_key: int, roll_sigma_rad: float, pitch_sigma_rad: float) -> gtsam.CustomFactor:
    """Return a prior that the camera's x and z axes are horizontal.

    A straight path, or fixes on a line, leave the rotation about that line undetermined. Residual (2,):
    ``[up . R e_x, up . R e_z]``, the sines of roll and pitch, where up is world z. Jacobian (2, 6): rows
    ``-up^T R [e]_x`` to the rotation, zero to the translation.

    Args:
        pose_key: Key of the pose ``world_T_camera``.
        roll_sigma_rad, pitch_sigma_rad: Standard deviations of roll and pitch.

    Raises:
        ValueError: A sigma is not positive.
    """
    if not (roll_sigma_rad > 0 and pitch_sigma_rad > 0):
        raise ValueError(f"sigmas are {roll_sigma_rad}, {pitch_sigma_rad} rad, expected positive numbers")

    def error(world_T_camera: gtsam.Pose3) -> Linearisation:
        up = world_T_camera.rotation().matrix()[2]
        jacobian = np.zeros((2, 6))
        jacobian[:, :3] = -up @ _SKEW
        return _AXES @ up, [jacobian]

    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([roll_sigma_rad, pitch_sigma_rad]))
    return custom_factor(noise, [Variable(pose_key, POSE3)], error)

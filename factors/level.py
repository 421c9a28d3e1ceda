"""A weak prior that the camera is level, for rotations that no other factor determines."""

from collections.abc import Sequence

import gtsam
import numpy as np
import numpy.typing as npt

from factors.custom import POSE3, Linearisation, Variable, custom_factor

CAMERA_RIGHT_AND_FORWARD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # roll and pitch raise them


def level_factor(
    pose_key: int, camera_axes: npt.NDArray[np.float64], sigmas_rad: Sequence[float]
) -> gtsam.CustomFactor:
    """Return a prior that axes of the camera are horizontal.

    A straight path, or fixes on a line, leave the rotation about that line undetermined. Residual (k,):
    ``up . R a`` of each axis a, the sine of its elevation, where up is world z; for the axes to the right and
    forward the sines of roll and pitch. Jacobian (k, 6): rows ``-up^T R [a]_x`` to the rotation, zero to the
    translation.

    Args:
        pose_key: Key of the pose ``world_T_camera``.
        camera_axes: (k, 3) unit vectors in the camera's frame.
        sigmas_rad: (k,) standard deviations of their elevations.

    Raises:
        ValueError: A sigma is not positive.
    """
    if not min(sigmas_rad) > 0:
        raise ValueError(f"sigmas are {list(sigmas_rad)} rad, expected positive numbers")

    across = np.stack([gtsam.SO3.Hat(axis) for axis in camera_axes])  # [a]_x

    def error(world_T_camera: gtsam.Pose3) -> Linearisation:
        up = world_T_camera.rotation().matrix()[2]
        jacobian = np.zeros((len(camera_axes), 6))
        jacobian[:, :3] = across @ up
        return camera_axes @ up, [jacobian]

    noise = gtsam.noiseModel.Diagonal.Sigmas(np.asarray(sigmas_rad))
    return custom_factor(noise, [Variable(pose_key, POSE3)], error)

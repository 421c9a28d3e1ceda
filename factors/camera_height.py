"""A camera's height above the ground as a measure of the way that it travels."""

import gtsam
import numpy as np

from factors.custom import POSE3, VECTOR1, FloatArray, Linearisation, Variable, custom_factor


def camera_height_factor(
    pose_keys: tuple[int, int], height_key: int, ratio: float, sigma: float
) -> gtsam.CustomFactor:
    """Return the constraint that two positions lie a known number of camera heights apart.

    What the video sees of the ground gives the ratio of height and distance, whatever its scale. Residual
    (1,): ``log(ratio |c_b - c_a| / h)``. Jacobians: ``-u^T R_a / d`` and ``u^T R_b / d`` (1, 6) to the
    translations, with ``u = (c_b - c_a) / d``, and ``-1 / h`` (1, 1) to the height.

    Args:
        pose_keys: Keys of the poses ``world_T_camera`` a and b.
        height_key: Key of the height h, a vector (1,), metres.
        ratio: Height over distance, as the video has it.
        sigma: Standard deviation of its logarithm.

    Raises:
        ValueError: Ratio or sigma is not positive.
    """
    if not (ratio > 0 and sigma > 0):
        raise ValueError(f"ratio and sigma are {ratio}, {sigma}, expected positive numbers")

    def error(a: gtsam.Pose3, b: gtsam.Pose3, height: FloatArray) -> Linearisation:
        apart = b.translation() - a.translation()
        distance = float(np.linalg.norm(apart))
        by_a, by_b = np.zeros((1, 6)), np.zeros((1, 6))
        by_a[0, 3:] = -apart @ a.rotation().matrix() / distance**2
        by_b[0, 3:] = apart @ b.rotation().matrix() / distance**2
        h = float(height[0])
        return np.array([np.log(ratio * distance / h)]), [by_a, by_b, np.array([[-1.0 / h]])]

    variables = [Variable(pose_keys[0], POSE3), Variable(pose_keys[1], POSE3), Variable(height_key, VECTOR1)]
    return custom_factor(gtsam.noiseModel.Isotropic.Sigma(1, sigma), variables, error)

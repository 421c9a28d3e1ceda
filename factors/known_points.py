"""A pose factor for observations of landmarks of known position."""

import gtsam
import numpy as np

from factors.custom import POSE3, FloatArray, Linearisation, Variable, custom_factor

_MIN_DEPTH_M = 1e-3


def known_points_factor(
    pose_key: int,
    world_p_points: FloatArray,
    uv_px: FloatArray,
    sigma_px: FloatArray,
    K: FloatArray,
    huber_px: float,
) -> gtsam.CustomFactor:
    """Return one factor for all landmarks of known position that a frame observes, each with Huber's loss.

    Residual (2N,): ``e s(|e|) / sigma`` for each landmark, where e is projection minus ``uv_px`` and ``s(x)^2
    x^2`` is Huber's loss, ``x^2`` up to ``huber_px`` and linear beyond; so half the squared residual is the
    robust cost, and the Jacobian (2N, 6) to the pose is exact. A landmark behind the camera contributes zero.
    One factor serves the whole frame, since a CustomFactor costs about the same for one landmark as for a
    hundred.

    Args:
        pose_key: Key of the pose (``Pose3``, world_T_camera).
        world_p_points: (N, 3) ENU metres, N >= 1.
        uv_px: (N, 2) observed positions in the undistorted image.
        sigma_px: (N,) standard deviations.
        K: (3, 3) camera matrix.
        huber_px: Error beyond which the cost is linear.

    Raises:
        ValueError: Shapes are inconsistent, or a sigma or ``huber_px`` is not positive.
    """
    points, uv = np.array(world_p_points, np.float64), np.array(uv_px, np.float64)
    sigma, n = np.array(sigma_px, np.float64), len(world_p_points)
    if n == 0 or points.shape != (n, 3) or uv.shape != (n, 2) or sigma.shape != (n,):
        raise ValueError(
            f"points {points.shape}, pixels {uv.shape}, sigmas {sigma.shape}: expected (N, 3), (N, 2), (N,)"
        )
    if not ((sigma > 0).all() and huber_px > 0):
        raise ValueError(f"smallest sigma_px is {sigma.min()}, huber_px {huber_px}, expected positive pixels")
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]

    def error(world_T_camera: gtsam.Pose3) -> Linearisation:
        pose = world_T_camera.matrix()
        camera_p = (points - pose[:3, 3]) @ pose[:3, :3]
        front = camera_p[:, 2] > _MIN_DEPTH_M
        inverse = front / np.where(front, camera_p[:, 2], 1.0)
        a, b = camera_p[:, 0] * inverse, camera_p[:, 1] * inverse
        # filled in place with points last: stacking small parts would take most of the time
        jacobian = np.zeros((2, 6, n))
        jacobian[0, :3], jacobian[1, :3] = (a * b, -1 - a * a, b), (1 + b * b, -a * b, -a)
        jacobian[0, 3] = jacobian[1, 4] = -inverse
        jacobian[0, 5], jacobian[1, 5] = a * inverse, b * inverse
        jacobian *= np.stack([fx * front, fy * front])[:, None]
        residual = np.stack([fx * a + cx - uv[:, 0], fy * b + cy - uv[:, 1]]) * front
        residual, jacobian = _huber(residual, jacobian, huber_px)
        jacobian /= sigma
        return (residual / sigma).T.ravel(), [jacobian.transpose(2, 0, 1).reshape(-1, 6)]

    return custom_factor(gtsam.noiseModel.Unit.Create(2 * n), [Variable(pose_key, POSE3)], error)


def _huber(residual: FloatArray, jacobian: FloatArray, huber_px: float) -> tuple[FloatArray, FloatArray]:
    """Return residuals (2, N) whose square is Huber's loss, and their Jacobians (2, d, N)."""
    size = np.sqrt(residual[0] ** 2 + residual[1] ** 2)
    if size.max() <= huber_px:
        return residual, jacobian
    far = np.maximum(size, huber_px)
    scale = np.sqrt(huber_px * (2 * far - huber_px)) / far
    # d scale / d size: from scale^2 = huber (2 size - huber) / size^2
    slope = np.where(size > huber_px, huber_px * (huber_px - far) / (scale * far**3), 0.0)
    by_size = slope / np.maximum(size, 1e-12) * (residual[0] * jacobian[0] + residual[1] * jacobian[1])
    return residual * scale, scale * jacobian + residual[:, None] * by_size

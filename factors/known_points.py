"""A camera against a map that is held: landmarks of known position, and a centre that moves steadily."""

import gtsam
import numpy as np

from factors.custom import POSE3, FloatArray, Linearised, Variable, custom_factor

_LEAST_DEPTH = 1e-3


def known_points_factor(
    pose_key: int,
    world_p_points: FloatArray,
    uv_px: FloatArray,
    sigma_px: FloatArray,
    K: FloatArray,
    huber_px: float,
) -> gtsam.CustomFactor:
    """All landmarks of known position that one frame sees, each with Huber's loss in pixels, as one factor.

    Residual (2N,): ``e s(|e|) / sigma`` for each landmark, where e is projection minus ``uv_px`` and
    ``s(x)^2 x^2`` is Huber's loss, ``x^2`` up to ``huber_px`` and linear beyond, so that half the squared
    residual is the robust cost itself, and the Jacobian (2N, 6) to the pose is exact. One factor for a frame,
    since a CustomFactor costs the same for one landmark or a hundred. A landmark behind the camera has no
    part.

    Args:
        pose_key: Key of the pose (``Pose3``, world_T_camera).
        world_p_points: (N, 3), N >= 1.
        uv_px: (N, 2), undistorted.
        sigma_px: (N,) standard deviations.
        K: (3, 3).
        huber_px: Errors beyond this cost linearly.

    Raises:
        ValueError: Shapes that do not fit, or a sigma or ``huber_px`` not positive.
    """
    points, uv = np.array(world_p_points, np.float64), np.array(uv_px, np.float64)
    sigma, n = np.array(sigma_px, np.float64), len(world_p_points)
    if n == 0 or points.shape != (n, 3) or uv.shape != (n, 2) or sigma.shape != (n,):
        raise ValueError(
            f"points {points.shape}, pixels {uv.shape}, sigmas {sigma.shape}: expected (N, 3), (N, 2), (N,)"
        )
    if not ((sigma > 0).all() and huber_px > 0):
        raise ValueError("standard deviations and huber_px must be positive")
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]

    def error(world_T_camera: gtsam.Pose3) -> Linearised:
        pose = world_T_camera.matrix()
        camera_p = (points - pose[:3, 3]) @ pose[:3, :3]
        front = camera_p[:, 2] > _LEAST_DEPTH
        inverse = front / np.where(front, camera_p[:, 2], 1.0)
        a, b = camera_p[:, 0] * inverse, camera_p[:, 1] * inverse
        # filled in place, points last: stacks of small parts took most of the time
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
    """Residuals (2, N) whose square is Huber's loss, and their Jacobians (2, d, N)."""
    size = np.sqrt(residual[0] ** 2 + residual[1] ** 2)
    if size.max() <= huber_px:
        return residual, jacobian
    far = np.maximum(size, huber_px)
    scale = np.sqrt(huber_px * (2 * far - huber_px)) / far
    # d scale / d size: from scale^2 = huber (2 size - huber) / size^2
    slope = np.where(size > huber_px, huber_px * (huber_px - far) / (scale * far**3), 0.0)
    by_size = slope / np.maximum(size, 1e-12) * (residual[0] * jacobian[0] + residual[1] * jacobian[1])
    return residual * scale, scale * jacobian + residual[:, None] * by_size


def steady_centre_factor(
    key_a: int, key_b: int, key_c: int, dt_ab_s: float, dt_bc_s: float, density_m_s1p5: float
) -> gtsam.CustomFactor:
    """The camera's centre moves at one velocity through three frames, however the camera turns meanwhile.

    Residual (3,): ``(c_c - c_b)/dt_bc - (c_b - c_a)/dt_ab`` [m/s], world axes: Eq. (5), Matsuda 2007, for the
    centre. Jacobians (3, 6) to T_a, T_b, T_c, zero in the rotations. Noise as in
    :func:`factors.gyro.constant_velocity_factor`: sigma ``density sqrt((dt_ab + dt_bc)/3)``.

    Args:
        key_a, key_b, key_c: Keys of the three poses, in order of time.
        dt_ab_s, dt_bc_s: Time between them.
        density_m_s1p5: White noise on the acceleration, m/s^2/sqrt(Hz).

    Raises:
        ValueError: A time or the density is not positive.
    """
    if not (dt_ab_s > 0 and dt_bc_s > 0 and density_m_s1p5 > 0):
        raise ValueError(f"times {dt_ab_s}, {dt_bc_s} s and density {density_m_s1p5}: expected positive")
    by_a, by_c = 1 / dt_ab_s, 1 / dt_bc_s

    def error(world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3, world_T_c: gtsam.Pose3) -> Linearised:
        a, b, c = (pose.translation() for pose in (world_T_a, world_T_b, world_T_c))
        jacobians = [
            np.hstack([np.zeros((3, 3)), factor * pose.rotation().matrix()])
            for factor, pose in ((by_a, world_T_a), (-by_a - by_c, world_T_b), (by_c, world_T_c))
        ]
        return (c - b) * by_c - (b - a) * by_a, jacobians

    noise = gtsam.noiseModel.Isotropic.Sigma(3, density_m_s1p5 * np.sqrt((dt_ab_s + dt_bc_s) / 3))
    return custom_factor(noise, [Variable(key, POSE3) for key in (key_a, key_b, key_c)], error)

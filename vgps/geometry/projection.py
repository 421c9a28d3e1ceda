"""Pinhole geometry of many points at once: projection, rays, triangulation and their derivatives.

Pixels are those of the undistorted image; ``world_T_camera`` maps camera to world coordinates. Observations
are flat arrays, one row each, sorted by feature: a feature observed in three views has three rows.
"""

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray

_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
MIN_DEPTH = 1e-6  # keeps the division by depth finite; points nearer than this count as behind


def project(K: FloatArray, world_T_camera: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return pixels and depths of points, Eq. (4), Kume 2010, in OpenCV's axes.

    Args:
        K: (3, 3).
        world_T_camera: (4, 4), or (S, 4, 4) for several cameras.
        points: (N, 3) in the world.

    Returns:
        ``uv_px`` (N, 2) or (S, N, 2), and depth (N,) or (S, N); pixels of points behind the camera are
        meaningless.
    """
    rotation, centre = world_T_camera[..., :3, :3], world_T_camera[..., None, :3, 3]
    return _to_pixels(K, (points - centre) @ rotation)


def _to_pixels(K: FloatArray, camera_p: FloatArray) -> tuple[FloatArray, FloatArray]:
    depth = camera_p[..., 2]
    safe = np.maximum(depth, MIN_DEPTH)
    uv = camera_p[..., :2] / safe[..., None] * (K[0, 0], K[1, 1]) + K[:2, 2]
    return uv, depth


def in_picture(lens: FloatArray | None, undistorted: FloatArray) -> FloatArray:
    """Return errors or derivatives (2, ..., N) of undistorted pixels as those of the picture's pixels.

    Args:
        lens: (N, 2, 2) from :mod:`vgps.lens_jacobian`; None for a pinhole, where they are the same.
        undistorted: (2, ..., N).
    """
    if lens is None:
        return undistorted
    u, v = undistorted
    return np.stack([row[:, 0] * u + row[:, 1] * v for row in lens.transpose(1, 0, 2)])


def rays(K: FloatArray, uv_px: FloatArray) -> FloatArray:
    """Return unit rays (..., 3) in the camera frame through pixels (..., 2)."""
    xy = (uv_px - K[:2, 2]) / (K[0, 0], K[1, 1])
    xyz = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    return np.asarray(xyz / np.linalg.norm(xyz, axis=-1, keepdims=True))


def world_rays(K: FloatArray, world_T_camera: FloatArray, uv_px: FloatArray) -> FloatArray:
    """Return unit rays (N, 3) in the world through pixels (N, 2) of cameras (N, 4, 4)."""
    return np.asarray((world_T_camera[:, :3, :3] @ rays(K, uv_px)[:, :, None])[:, :, 0])


def largest_angle_rad(directions: FloatArray, start: IntArray) -> FloatArray:
    """Return the largest angle between the rays of each feature, a criterion of stage B (Kume 2010).

    Rays are compared with the first and the last one only, the extremes of a steady motion.

    Args:
        directions: (N, 3) unit rays in the world, sorted by feature.
        start: (M,) first row of each feature.

    Returns:
        (M,) radians.
    """
    count = np.diff(np.append(start, len(directions)))
    end = start + count - 1
    to_first = np.sum(directions * np.repeat(directions[start], count, axis=0), axis=1)
    to_last = np.sum(directions * np.repeat(directions[end], count, axis=0), axis=1)
    smallest = np.minimum.reduceat(np.minimum(to_first, to_last), start)
    return np.asarray(np.arccos(np.clip(smallest, -1.0, 1.0)))


def triangulate(
    K: FloatArray,
    world_T_camera: FloatArray,
    uv_px: FloatArray,
    start: IntArray,
    iterations: int = 3,
    lens: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return each feature's position from all its views, Eq. (19), Kume 2010.

    Gauss-Newton on the reprojection errors, from the point nearest to all rays.

    Args:
        K: (3, 3).
        world_T_camera: (N, 4, 4) the camera of each observation.
        uv_px: (N, 2), sorted by feature.
        start: (M,) first row of each feature.
        iterations: Gauss-Newton steps.
        lens: As for :func:`in_picture`.

    Returns:
        ``points`` (M, 3) and the reprojection error (N,) of each observation in pixels of the picture,
        infinite where the point lies behind the camera.
    """
    count = np.diff(np.append(start, len(uv_px)))
    centre = world_T_camera[:, :3, 3]
    direction = world_rays(K, world_T_camera, uv_px)
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    right = (across @ centre[:, :, None])[:, :, 0]
    points = _solve(np.add.reduceat(across, start), np.add.reduceat(right, start))
    # observations last: the arithmetic runs along contiguous memory
    axes = np.ascontiguousarray(world_T_camera[:, :3, :3].transpose(2, 1, 0))
    centre, uv = np.ascontiguousarray(centre.T), np.ascontiguousarray(uv_px.T)
    points = np.ascontiguousarray(points.T)
    for _ in range(iterations):
        camera_p = _in_cameras(axes, np.repeat(points, count, axis=1) - centre)
        points += _step(K, axes, camera_p, uv, start, lens)
    x, y, z = _in_cameras(axes, np.repeat(points, count, axis=1) - centre)
    safe = np.maximum(z, MIN_DEPTH)
    u, v = K[0, 0] * x / safe + K[0, 2] - uv[0], K[1, 1] * y / safe + K[1, 2] - uv[1]
    error = np.hypot(*in_picture(lens, np.stack([u, v])))
    error[z <= MIN_DEPTH] = np.inf
    return points.T, error


def _in_cameras(axes: FloatArray, world_v: FloatArray) -> FloatArray:
    """Return world vectors (3, N) in the axes (3 axes, 3 world coordinates, N) of their cameras."""
    return np.asarray(axes[:, 0] * world_v[0] + axes[:, 1] * world_v[1] + axes[:, 2] * world_v[2])


def _step(
    K: FloatArray,
    axes: FloatArray,
    camera_p: FloatArray,
    uv: FloatArray,
    start: IntArray,
    lens: FloatArray | None,
) -> FloatArray:
    """Return the Gauss-Newton step (3, M) of features observed at (2, N), now at (3, N) in the cameras."""
    front = camera_p[2] > MIN_DEPTH
    inverse = front / np.where(front, camera_p[2], 1.0)
    a, b = camera_p[0] * inverse, camera_p[1] * inverse
    by_u = K[0, 0] * inverse * (axes[0] - a * axes[2])
    by_v = K[1, 1] * inverse * (axes[1] - b * axes[2])
    u, v = K[0, 0] * a + (K[0, 2] - uv[0]), K[1, 1] * b + (K[1, 2] - uv[1])
    if lens is not None:
        by_u, by_v = in_picture(lens, np.stack([by_u, by_v]))
        u, v = in_picture(lens, np.stack([u, v]))
    gradient = np.add.reduceat(by_u * u + by_v * v, start, axis=1)
    squares = np.stack([by_u[i] * by_u[j] + by_v[i] * by_v[j] for i, j in _UPPER])
    normal = np.add.reduceat(squares, start, axis=1)[_SYMMETRIC]
    return -_solve(normal.transpose(2, 0, 1), gradient.T).T


def _solve(normal: FloatArray, right: FloatArray) -> FloatArray:
    # parallel rays make the system singular; with damping the feature ends far away instead
    trace = np.trace(normal, axis1=1, axis2=2)
    damped = normal + (1e-9 * trace + 1e-300)[:, None, None] * np.eye(3)
    return np.asarray(np.linalg.solve(damped, right[..., None])[..., 0])


def linearise_projection(
    K: FloatArray, pose: FloatArray, points: FloatArray, uv_px: FloatArray, lens: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return reprojection residuals (N, 2) and Jacobians (N, 2, 6) to the pose; zero behind the camera.

    Both are of the picture's pixels, by ``lens`` as for :func:`in_picture`.
    """
    camera_p = (points - pose[:3, 3]) @ pose[:3, :3]
    front = camera_p[:, 2] > MIN_DEPTH
    inverse = front / np.where(front, camera_p[:, 2], 1.0)
    a, b = camera_p[:, 0] * inverse, camera_p[:, 1] * inverse
    ab = a * b
    # observations last while it is filled: the arithmetic runs along contiguous memory
    jacobian = np.zeros((2, 6, len(points)))
    jacobian[0, :3] = ab, -1.0 - a * a, b
    jacobian[1, :3] = 1.0 + b * b, -ab, -a
    jacobian[0, 3] = jacobian[1, 4] = -inverse
    jacobian[0, 5], jacobian[1, 5] = a * inverse, b * inverse
    jacobian[0] *= K[0, 0] * front
    jacobian[1] *= K[1, 1] * front
    residual = np.stack([K[0, 0] * a + (K[0, 2] - uv_px[:, 0]), K[1, 1] * b + (K[1, 2] - uv_px[:, 1])])
    return in_picture(lens, residual * front).T, in_picture(lens, jacobian).transpose(2, 0, 1)


def reprojection_inliers(
    K: FloatArray,
    world_T_camera: FloatArray,
    points: FloatArray,
    uv_px: FloatArray,
    limit_px: float,
    lens: FloatArray | None = None,
) -> BoolArray:
    """Return whether each match (N,) reprojects within ``limit_px`` and lies in front of the camera.

    The limit is in pixels of the picture, by ``lens`` as for :func:`in_picture`.
    """
    predicted, depth = project(K, world_T_camera, points)
    error = np.hypot(*in_picture(lens, (predicted - uv_px).T))
    return np.asarray((error < limit_px) & (depth > MIN_DEPTH))


def world_sigmas(poses: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return standard deviations (F, 3) of rotation [rad] and position [m] about and along world axes.

    Args:
        poses: (F, 4, 4).
        covariance: (F, 6, 6) in the camera's tangent [rotation; translation].
    """
    R = poses[:, :3, :3]

    def sigma(block: FloatArray) -> FloatArray:
        world = R @ block @ R.transpose(0, 2, 1)
        return np.asarray(np.sqrt(np.diagonal(world, axis1=1, axis2=2)))

    return sigma(covariance[:, :3, :3]), sigma(covariance[:, 3:, 3:])

"""Pinhole geometry of many points at once: projecting, rays, triangulating (19), angles between rays.

Pixels here are of the undistorted image; ``world_T_camera`` maps camera to world coordinates.
"""

import numpy as np

from vgps.model import BoolArray, FloatArray

MIN_DEPTH = 1e-6


def project(K: FloatArray, world_T_camera: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixels and depths of points, Eq. (4) Kume 2010 in OpenCV's axes.

    Args:
        K: (3, 3).
        world_T_camera: (..., 4, 4), broadcast against the points.
        points: (..., 3) in the world.

    Returns:
        ``uv_px`` (..., 2) and depth (...,); pixels of points behind the camera are meaningless.
    """
    rotation, centre = world_T_camera[..., :3, :3], world_T_camera[..., :3, 3]
    camera_p = np.einsum("...ji,...j->...i", rotation, points - centre)
    depth = camera_p[..., 2]
    safe = np.where(depth > MIN_DEPTH, depth, MIN_DEPTH)
    uv = camera_p[..., :2] / safe[..., None] * (K[0, 0], K[1, 1]) + K[:2, 2]
    return uv, depth


def rays(K: FloatArray, uv_px: FloatArray) -> FloatArray:
    """Unit rays (..., 3) in the camera frame through pixels (..., 2)."""
    xy = (uv_px - K[:2, 2]) / (K[0, 0], K[1, 1])
    xyz = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    return np.asarray(xyz / np.linalg.norm(xyz, axis=-1, keepdims=True))


def largest_angle_rad(world_rays: FloatArray, seen: BoolArray) -> FloatArray:
    """Largest angle between the rays of each feature: a test of stage B (Kume 2010).

    Compared with the first and with the last ray, which are the extremes of a steady motion.

    Args:
        world_rays: (M, H, 3) unit rays in the world.
        seen: (M, H), at least one true a row.

    Returns:
        (M,) radians.
    """
    rows = np.arange(len(seen))
    first = world_rays[rows, seen.argmax(axis=1)]
    last = world_rays[rows, seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1)]
    ends = np.stack([first, last], axis=1)
    cosine = np.einsum("mhi,mei->mhe", world_rays, ends)
    smallest = np.where(seen[..., None], cosine, 1.0).min(axis=(1, 2), initial=1.0)
    return np.asarray(np.arccos(np.clip(smallest, -1.0, 1.0)))


def triangulate(
    K: FloatArray, world_T_camera: FloatArray, uv_px: FloatArray, seen: BoolArray, iterations: int = 3
) -> tuple[FloatArray, FloatArray]:
    """Each feature's position from all its views, Eq. (19), Kume 2010.

    Starts from the point nearest to all rays, then Gauss-Newton on the reprojection errors.

    Args:
        K: (3, 3).
        world_T_camera: (H, 4, 4) the views.
        uv_px: (M, H, 2), anything where not seen.
        seen: (M, H).
        iterations: Gauss-Newton steps.

    Returns:
        ``points`` (M, 3) and the reprojection errors (M, H) in pixels, zero where not seen and infinite where
        the point lies behind a camera that saw it.
    """
    weight = seen.astype(np.float64)
    rotation, centres = world_T_camera[:, :3, :3], world_T_camera[:, :3, 3]
    direction = np.einsum("hij,mhj->mhi", rotation, rays(K, np.where(seen[..., None], uv_px, 0.0)))
    across = np.eye(3) - direction[..., :, None] * direction[..., None, :]
    normal = np.einsum("mh,mhij->mij", weight, across)
    right = np.einsum("mh,mhij,hj->mi", weight, across, centres)
    points = _solve(normal, right)
    for _ in range(iterations):
        points = points + _reprojection_step(K, rotation, centres, uv_px, weight, points)
    predicted, depth = project(K, world_T_camera[None], points[:, None])
    error = np.linalg.norm(np.where(seen[..., None], predicted - uv_px, 0.0), axis=-1)
    error[seen & (depth <= MIN_DEPTH)] = np.inf
    return points, error


def _reprojection_step(
    K: FloatArray,
    rotation: FloatArray,
    centres: FloatArray,
    uv_px: FloatArray,
    weight: FloatArray,
    points: FloatArray,
) -> FloatArray:
    camera_p = np.einsum("hji,mhj->mhi", rotation, points[:, None] - centres)
    good = (camera_p[..., 2] > MIN_DEPTH) & (weight > 0)
    x, y, z = np.moveaxis(np.where(good[..., None], camera_p, 1.0), -1, 0)
    fx, fy = K[0, 0], K[1, 1]
    zero = np.zeros_like(z)
    by_camera = np.stack([fx / z, zero, -fx * x / z**2, zero, fy / z, -fy * y / z**2], axis=-1)
    jacobian = np.einsum("mhri,hji->mhrj", by_camera.reshape(*z.shape, 2, 3), rotation)
    jacobian *= good[..., None, None]
    residual = np.stack([fx * x / z + K[0, 2], fy * y / z + K[1, 2]], axis=-1) - uv_px
    residual = np.where(good[..., None], residual, 0.0)
    normal = np.einsum("mhri,mhrj->mij", jacobian, jacobian)
    return -_solve(normal, np.einsum("mhri,mhr->mi", jacobian, residual))


def _solve(normal: FloatArray, right: FloatArray) -> FloatArray:
    # a feature whose rays are parallel has a singular system: a little damping sends it far away
    trace = np.einsum("mii->m", normal)
    damped = normal + (1e-9 * trace + 1e-300)[:, None, None] * np.eye(3)
    return np.asarray(np.linalg.solve(damped, right[..., None])[..., 0])

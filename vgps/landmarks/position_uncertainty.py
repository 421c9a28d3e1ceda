"""Uncertainty of a landmark's position, from the rays of its observations."""

import numpy as np

from vgps.model import FloatArray, IntArray


def position_sigmas_m(
    K: FloatArray, world_T_camera: FloatArray, points: FloatArray, start: IntArray, sigma_px: FloatArray
) -> FloatArray:
    """Return the standard deviation of each landmark along its least certain axis, given the poses.

    The covariance is the inverse of ``sum J^T J / sigma^2`` over a landmark's observations, with J of
    Eq. (4), Kume 2010.

    Args:
        K: (3, 3).
        world_T_camera: (N, 4, 4) pose of each observation.
        points: (N, 3) landmark of each observation.
        start: (M,) first observation of each landmark.
        sigma_px: (M,) standard deviation of one observation.

    Returns:
        (M,) metres; infinite where the rays do not determine the position.
    """
    rotation = world_T_camera[:, :3, :3]
    camera_p = np.einsum("nij,ni->nj", rotation, points - world_T_camera[:, :3, 3])
    x, y, z = camera_p.T
    zero = np.zeros_like(z)
    by_camera = np.stack(
        [K[0, 0] / z, zero, -K[0, 0] * x / z**2, zero, K[1, 1] / z, -K[1, 1] * y / z**2], axis=1
    )
    jacobian = by_camera.reshape(-1, 2, 3) @ rotation.transpose(0, 2, 1)
    information = np.add.reduceat(jacobian.transpose(0, 2, 1) @ jacobian, start)
    least = np.linalg.eigvalsh(information)[:, 0]
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(least > 0, sigma_px / np.sqrt(np.maximum(least, 0)), np.inf))

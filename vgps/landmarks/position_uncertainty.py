"""How well a landmark's position is known, from the rays by which it was seen."""

import numpy as np

from vgps.model import FloatArray, IntArray


def position_sigmas_m(
    K: FloatArray, world_T_camera: FloatArray, points: FloatArray, start: IntArray, sigma_px: FloatArray
) -> FloatArray:
    """Standard deviation of each landmark along its least known axis, the poses held.

    The inverse of ``sum J^T J / sigma^2`` over the observations of a landmark, J of Eq. (4), Kume 2010.

    Args:
        K: (3, 3).
        world_T_camera: (N, 4, 4) the camera of each observation.
        points: (N, 3) the landmark of each observation.
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

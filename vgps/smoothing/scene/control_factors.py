"""Factors of observed control points, with the standard deviations that these points have in the images."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import control_point_factor, projection_noise
from vgps.mapping.control_observations import ControlObservations
from vgps.model import FloatArray

_NEAREST_M = 0.1  # a nearer control point is taken to be this far away


def control_factors(
    controls: ControlObservations, sigma_px: FloatArray, K: FloatArray
) -> gtsam.NonlinearFactorGraph:
    """Return a factor for each observation of a control point.

    Args:
        controls: The observations.
        sigma_px: (N,) from :func:`control_sigma_px`.
        K: (3, 3) calibration matrix.
    """
    graph = gtsam.NonlinearFactorGraph()
    calibration = gtsam.Cal3_S2(K[0, 0], K[1, 1], 0.0, K[0, 2], K[1, 2])
    for frame, uv, point, sigma in zip(
        controls.frame.tolist(), controls.uv_px, controls.world_p_point, sigma_px.tolist(), strict=True
    ):
        graph.push_back(control_point_factor(X(frame), uv, point, calibration, projection_noise(sigma)))
    return graph


def control_sigma_px(
    controls: ControlObservations, poses: FloatArray, K: FloatArray, observation_px: float
) -> FloatArray:
    """Return the standard deviations (N,) of observation and position together, pixels.

    Args:
        controls: The observations.
        poses: (F, 4, 4) world_T_camera, approximately.
        K: (3, 3) calibration matrix.
        observation_px: Standard deviation of an observation.
    """
    return np.hypot(observation_px, _projected_sigma_px(controls, poses[controls.frame], K))


def _projected_sigma_px(controls: ControlObservations, pose: FloatArray, K: FloatArray) -> FloatArray:
    """Return (N,) standard deviations of the points' positions as their images show them, pixels."""
    camera_R_world = np.swapaxes(pose[:, :3, :3], 1, 2)
    p = np.einsum("nij,nj->ni", camera_R_world, controls.world_p_point - pose[:, :3, 3])
    depth = np.maximum(np.abs(p[:, 2]), _NEAREST_M)
    # rows of the projection's Jacobian: f / z (1, 0, -x / z) and f / z (0, 1, -y / z)
    across = camera_R_world[:, :2] - (p[:, :2] / depth[:, None])[:, :, None] * camera_R_world[:, 2:3]
    scale = np.array([K[0, 0], K[1, 1]]) / depth[:, None]
    variance = scale**2 * np.einsum("nij,nj->ni", across**2, controls.sigma_m**2)
    return np.asarray(np.sqrt(variance.mean(axis=1)))

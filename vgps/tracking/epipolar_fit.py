"""Epipolar geometry of two views: rotation and direction of motion by least squares, with covariance."""

from dataclasses import dataclass
from typing import NamedTuple

import gtsam
import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import RotationConfig
from vgps.model import BoolArray, FloatArray

_CONVERGED = 1e-6  # rad


@dataclass(frozen=True)
class TwoViews:
    """The same features in two views: rays (N, 3) with z = 1 in either camera, and the focal length."""

    first: FloatArray
    second: FloatArray
    focal_px: float


class EpipolarFit(NamedTuple):
    """Rotation, direction of motion in the second's axes, covariance of the rotation in the first's axes,
    share of inliers, and cost between 0 and 1."""

    second_R_first: FloatArray
    direction: FloatArray
    covariance: FloatArray
    inlier_share: float
    cost: float


def fit_epipolar_geometry(
    second_R_first: FloatArray,
    direction: FloatArray,
    views: TwoViews,
    config: RotationConfig,
    iterations: int = 6,
) -> EpipolarFit:
    """Minimise the robust Sampson distance over rotation and direction of motion by Gauss-Newton.

    Args:
        second_R_first: (3, 3) initial rotation.
        direction: (3,) initial direction of motion, a unit vector in the second camera's axes.
        views: The features.
        config: Limits of the matches.
        iterations: Upper limit.
    """
    rotation, information, residual = second_R_first, np.eye(5), np.zeros(len(views.first))
    for _ in range(iterations):
        jacobian, residual = _sampson(rotation, direction, views)
        weight = 1 / (1 + (residual / config.inlier_px) ** 2)
        # a pure rotation leaves the direction undetermined; a prior of one radian bounds it
        information = (weight[:, None] * jacobian).T @ jacobian + np.diag([0.0, 0.0, 0.0, 1.0, 1.0])
        information += 1e-9 * np.trace(information) * np.eye(5)
        step = -np.linalg.solve(information, jacobian.T @ (weight * residual))
        rotation = rotation @ Rotation.from_rotvec(step[:3]).as_matrix()
        direction = direction + _tangent_basis(direction) @ step[3:]
        direction = direction / np.linalg.norm(direction)
        if np.abs(step).max() < _CONVERGED:
            break
    inlier = np.abs(residual) < config.inlier_px
    behind = _behind(rotation, direction, views, config.inlier_px)
    cost = np.where(behind, 1.0, np.minimum((residual / config.inlier_px) ** 2, 1.0)).mean()
    sigma = max(
        1.4826 * float(np.median(np.abs(residual[inlier]))) if inlier.any() else 1.0, config.sigma_floor_px
    )
    covariance = np.asarray(sigma**2 * np.linalg.inv(information)[:3, :3], np.float64)
    return EpipolarFit(rotation, direction, covariance, float((inlier & ~behind).mean()), float(cost))


def _behind(rotation: FloatArray, direction: FloatArray, views: TwoViews, inlier_px: float) -> BoolArray:
    """Return (N,) whether a feature moved along its epipolar line as if it were behind the cameras."""
    second, focal_px = views.second, views.focal_px
    rotated = views.first @ rotation.T
    parallax = second[:, :2] - rotated[:, :2] / rotated[:, 2:]
    # second = rotated + direction / depth, in the image
    outward = direction[:2] - direction[2] * second[:, :2]
    along = np.sum(parallax * outward, axis=1) / np.maximum(np.linalg.norm(outward, axis=1), 1e-12) * focal_px
    backward = along < -2 * inlier_px
    forward = along > 2 * inlier_px
    # the sign of the direction is arbitrary: most features are in front
    return np.asarray(backward if backward.sum() < forward.sum() else forward)


def _sampson(rotation: FloatArray, direction: FloatArray, views: TwoViews) -> tuple[FloatArray, FloatArray]:
    """Return Sampson distances (N,) in pixels and Jacobians (N, 5) by rotation (first's axes), direction."""
    first, second = views.first, views.second
    rotated = first @ rotation.T
    cross = gtsam.Rot3.Hat(direction)
    line = rotated @ cross.T  # in the second image
    other = second @ cross @ rotation  # in the first
    scale = views.focal_px / np.maximum(np.hypot(np.hypot(*line[:, :2].T), np.hypot(*other[:, :2].T)), 1e-12)
    by_rotation = np.cross(first, other)
    by_direction = np.cross(rotated, second) @ _tangent_basis(direction)
    jacobian = np.hstack([by_rotation, by_direction]) * scale[:, None]
    return jacobian, np.sum(line * second, axis=1) * scale


def _tangent_basis(direction: FloatArray) -> FloatArray:
    """Return two unit vectors (3, 2) perpendicular to a direction and to each other."""
    return np.asarray(gtsam.Unit3(direction).basis())

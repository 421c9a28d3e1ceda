"""Pose of one frame from landmarks of known position, (E) of Matsuda 2007: RANSAC, linear, then refined."""

from dataclasses import dataclass

import cv2
import gtsam
import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import linearise_projection, reprojection_inliers
from vgps.model import BoolArray, FloatArray

_LEAST = 4  # matches a linear solution needs
_SETTLED = 0.03  # standard deviations: no step worth another
_MOST_STEPS = 16  # a guard: inliers and pose settle within a few


@dataclass(frozen=True)
class PoseEstimate:
    """A pose with what supports it.

    Attributes:
        world_T_camera: (4, 4).
        covariance: (6, 6) in the camera's tangent, rotation then translation.
        inlier: (N,) matches that agree.
    """

    world_T_camera: FloatArray
    covariance: FloatArray
    inlier: BoolArray


def pose_from_matches(
    K: FloatArray,
    points: FloatArray,
    uv_px: FloatArray,
    sigma_px: FloatArray,
    limit_px: float,
    config: LocalizationConfig,
    guess: FloatArray | None = None,
) -> PoseEstimate | None:
    """Robust pose: samples with a linear solution, then least reprojection error over those that agree.

    Args:
        K: (3, 3).
        points: (N, 3) in the world.
        uv_px: (N, 2), undistorted.
        sigma_px: (N,) standard deviations of the matches.
        limit_px: A match agrees with a pose if it is this near.
        config: Sampling, and Huber's constant.
        guess: (4, 4) a pose that competes with the samples.

    Returns:
        The pose with most support, or nothing if not even a linear solution exists.
    """
    if len(points) < _LEAST:
        return None
    best, support = guess, 0
    if guess is not None:
        support = int(reprojection_inliers(K, guess, points, uv_px, limit_px).sum())
    if support < config.skip_ransac_share * len(points):
        sampled = _ransac(K, points, uv_px, limit_px, config)
        if sampled is not None and reprojection_inliers(K, sampled, points, uv_px, limit_px).sum() > support:
            best = sampled
    return None if best is None else _settle(K, best, points, uv_px, sigma_px, limit_px, config.huber_px)


def _ransac(
    K: FloatArray, points: FloatArray, uv_px: FloatArray, limit_px: float, config: LocalizationConfig
) -> FloatArray | None:
    # about their own middle: world coordinates of hundreds of metres cost the solver digits
    middle = points.mean(axis=0)
    try:
        ok, rotation, translation, inlier = cv2.solvePnPRansac(
            points - middle,
            uv_px,
            K,
            None,
            iterationsCount=config.ransac_samples,
            reprojectionError=limit_px,
            confidence=config.ransac_confidence,
            flags=cv2.SOLVEPNP_AP3P,
        )
    except cv2.error:  # how OpenCV says that points coincide or lie in a line
        return None
    if not ok or inlier is None or not np.isfinite(translation).all():
        return None
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(rotation)[0].T
    pose[:3, 3] = middle - pose[:3, :3] @ translation[:, 0]
    return pose


def _settle(
    K: FloatArray,
    pose: FloatArray,
    points: FloatArray,
    uv_px: FloatArray,
    sigma_px: FloatArray,
    limit_px: float,
    huber_px: float,
) -> PoseEstimate | None:
    """Refine, deciding anew at every step which matches agree, until that settles."""
    inlier = reprojection_inliers(K, pose, points, uv_px, limit_px)
    covariance = np.full((6, 6), np.nan)
    for _ in range(_MOST_STEPS):
        if inlier.sum() < _LEAST:
            return None
        pose, covariance, moved = _step(K, pose, points[inlier], uv_px[inlier], sigma_px[inlier], huber_px)
        before, inlier = inlier, reprojection_inliers(K, pose, points, uv_px, limit_px)
        if moved < _SETTLED and np.array_equal(before, inlier):
            break
    return PoseEstimate(pose, covariance, inlier) if inlier.sum() >= _LEAST else None


def _step(
    K: FloatArray,
    pose: FloatArray,
    points: FloatArray,
    uv_px: FloatArray,
    sigma_px: FloatArray,
    huber_px: float,
) -> tuple[FloatArray, FloatArray, float]:
    """One step: the pose after it, the covariance before it, and the step's size in sigmas."""
    residual, jacobian = linearise_projection(K, pose, points, uv_px)
    size = np.sqrt(np.einsum("ni,ni->n", residual, residual))
    weight = np.minimum(1.0, huber_px / np.maximum(size, 1e-12)) / sigma_px**2
    weighted = (weight[:, None, None] * jacobian).reshape(-1, 6)
    information = weighted.T @ jacobian.reshape(-1, 6)
    information[np.diag_indices(6)] += 1e-9 * np.diag(information) + 1e-9
    spread = float(weight @ size**2) / max(2 * len(points) - 6, 1)
    covariance = np.linalg.inv(information)
    step = np.clip(-covariance @ (weighted.T @ residual.ravel()), -10, 10)
    moved = pose @ gtsam.Pose3.Expmap(step).matrix()
    size_in_sigmas = float(np.sqrt(step @ information @ step))
    return moved, np.asarray(covariance * max(spread, 1.0)), size_in_sigmas

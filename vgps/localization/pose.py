"""Pose of one frame from matched landmarks, (E) of Matsuda 2007: RANSAC, linear solution, refinement."""

from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.config import LocalizationConfig
from vgps.geometry import linearise_projection, reprojection_inliers
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.tracking.pose import Correspondences, ransac_pose

_MIN_MATCHES = 4  # of the linear solution
_CONVERGED = 0.03  # step in standard deviations
_MAX_STEPS = 16  # a guard: inliers and pose converge within a few


@dataclass(frozen=True, kw_only=True)
class LandmarkMatches:
    """Landmarks matched in a frame.

    Attributes:
        landmark: (N,) ids.
        world_p_landmark: (N, 3).
        uv_px: (N, 2) undistorted, as all of them would have been seen at the time of the frame.
        sigma_px: (N,) standard deviations, of match and landmark together.
        shift_px: (N, 2) what a rolling shutter adds to ``uv_px``.
    """

    landmark: IntArray
    world_p_landmark: FloatArray
    uv_px: FloatArray
    sigma_px: FloatArray
    shift_px: FloatArray

    @property
    def seen_px(self) -> FloatArray:
        """(N, 2) undistorted pixels where the image shows them."""
        return self.uv_px + self.shift_px

    def __len__(self) -> int:
        return len(self.landmark)

    def take(self, rows: BoolArray | IntArray) -> "LandmarkMatches":
        """Return the matches in ``rows``."""
        return LandmarkMatches(**{name: values[rows] for name, values in vars(self).items()})

    def inliers(self, K: FloatArray, world_T_camera: FloatArray, limit_px: float) -> BoolArray:
        """Return which matches (N,) lie within ``limit_px`` of their projections."""
        return reprojection_inliers(K, world_T_camera, self.world_p_landmark, self.uv_px, limit_px)


NO_MATCHES = LandmarkMatches(
    landmark=np.zeros(0, np.int64),
    world_p_landmark=np.zeros((0, 3)),
    uv_px=np.zeros((0, 2)),
    sigma_px=np.zeros(0),
    shift_px=np.zeros((0, 2)),
)


@dataclass(frozen=True)
class PoseEstimate:
    """A pose with its support.

    Attributes:
        world_T_camera: (4, 4).
        covariance: (6, 6) in the camera's tangent space, rotation then translation.
        inlier: (N,) whether each match agrees.
    """

    world_T_camera: FloatArray
    covariance: FloatArray
    inlier: BoolArray


def pose_from_matches(
    K: FloatArray,
    matches: LandmarkMatches,
    inlier_px: float,
    config: LocalizationConfig,
    initial: FloatArray | None = None,
) -> PoseEstimate | None:
    """Estimate a pose robustly: the best of samples and initial pose, refined on its inliers.

    Args:
        K: (3, 3).
        matches: N matches.
        inlier_px: A match within this distance of its projection is an inlier.
        config: Sampling, and Huber's constant.
        initial: (4, 4) a pose that competes with the samples.

    Returns:
        The pose with most inliers, or None if there is no linear solution or too few inliers.
    """
    if len(matches) < _MIN_MATCHES:
        return None
    best, support = initial, 0
    if initial is not None:
        support = int(matches.inliers(K, initial, inlier_px).sum())
    if support < config.skip_ransac_share * len(matches):
        points = Correspondences(matches.world_p_landmark, matches.uv_px)
        sampled = ransac_pose(K, points, inlier_px, config.ransac_samples, config.ransac_confidence)
        if sampled is not None and matches.inliers(K, sampled, inlier_px).sum() > support:
            best = sampled
    return None if best is None else _refine(K, best, matches, inlier_px, config.huber_px)


def _refine(
    K: FloatArray, pose: FloatArray, matches: LandmarkMatches, inlier_px: float, huber_px: float
) -> PoseEstimate | None:
    """Minimise the reprojection error, selecting the inliers anew at every step, until both converge."""
    inlier = matches.inliers(K, pose, inlier_px)
    covariance = np.full((6, 6), np.nan)
    for _ in range(_MAX_STEPS):
        if inlier.sum() < _MIN_MATCHES:
            return None
        pose, covariance, moved = _step(K, pose, matches.take(inlier), huber_px)
        before, inlier = inlier, matches.inliers(K, pose, inlier_px)
        if moved < _CONVERGED and np.array_equal(before, inlier):
            break
    return PoseEstimate(pose, covariance, inlier) if inlier.sum() >= _MIN_MATCHES else None


def _step(
    K: FloatArray, pose: FloatArray, matches: LandmarkMatches, huber_px: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return the pose after one Gauss-Newton step, the covariance before it, and its size in sigmas."""
    residual, jacobian = linearise_projection(K, pose, matches.world_p_landmark, matches.uv_px)
    size = np.sqrt(np.einsum("ni,ni->n", residual, residual))
    weight = np.minimum(1.0, huber_px / np.maximum(size, 1e-12)) / matches.sigma_px**2
    weighted = (weight[:, None, None] * jacobian).reshape(-1, 6)
    information = weighted.T @ jacobian.reshape(-1, 6)
    information[np.diag_indices(6)] += 1e-9 * np.diag(information) + 1e-9
    variance_factor = float(weight @ size**2) / max(2 * len(matches) - 6, 1)
    covariance = np.linalg.inv(information)
    step = np.clip(-covariance @ (weighted.T @ residual.ravel()), -10, 10)
    moved = pose @ gtsam.Pose3.Expmap(step).matrix()
    size_in_sigmas = float(np.sqrt(step @ information @ step))
    return moved, np.asarray(covariance * max(variance_factor, 1.0)), size_in_sigmas

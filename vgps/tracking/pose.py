"""Pose of one frame from features of known position: least median of squares (A-3), then Eq. (18)."""

from dataclasses import dataclass

import cv2
import gtsam
import numpy as np
import numpy.typing as npt

from vgps.geometry import MIN_DEPTH, in_picture, linearise_projection, project, reprojection_inliers
from vgps.model import BoolArray, FloatArray

_HUBER_PX = 1.0  # beyond it errors count linearly, so that one outlier does not tilt the frame
_SAMPLES, _CONFIDENCE = 1000, 0.999  # of a pose by random samples
_SMALL_DECREASE = 1e-6  # of the cost (18), in which an error of one standard deviation counts 1/2


@dataclass(frozen=True)
class Correspondences:
    """Points (N, 3) of the world and where one frame shows them, ``uv_px`` (N, 2) undistorted.

    ``lens`` (N, 2, 2), from :mod:`vgps.lens_jacobian`, makes errors those of the picture.
    """

    points: FloatArray
    uv_px: FloatArray
    lens: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.points)

    def where(self, kept: BoolArray) -> "Correspondences":
        """Return the correspondences that a mask (N,) keeps."""
        lens = None if self.lens is None else self.lens[kept]
        return Correspondences(self.points[kept], self.uv_px[kept], lens)

    def inliers(self, K: FloatArray, world_T_camera: FloatArray, limit_px: float) -> BoolArray:
        """Return (N,) whether each point reprojects within a limit under a pose (4, 4)."""
        return reprojection_inliers(K, world_T_camera, self.points, self.uv_px, limit_px, self.lens)


@dataclass(frozen=True)
class Prediction:
    """Predicted pose (4, 4) of a frame; ``rotation_sigma_rad`` about each axis, inf without a gyro."""

    world_T_camera: FloatArray
    rotation_sigma_rad: float = np.inf

    @property
    def by_gyro(self) -> bool:
        """Whether a gyro gave the rotation."""
        return bool(np.isfinite(self.rotation_sigma_rad))

    def beside(self, sigma_scale: float) -> "Prediction":
        """Return the prediction as it weighs beside features whose sigmas are too small by this factor.

        Their errors are common to many of them, which their number hides.
        """
        return Prediction(self.world_T_camera, self.rotation_sigma_rad / sigma_scale)


def refine_pose(
    K: FloatArray,
    world_T_camera: FloatArray,
    matches: Correspondences,
    mu: FloatArray,
    iterations: int = 8,
    prior: Prediction | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Minimise Eq. (18), Kume 2010, ``sum_j mu_j rho(||q - q^||)``, over one pose by Gauss-Newton.

    Args:
        K: (3, 3).
        world_T_camera: (4, 4) initial pose.
        matches: N correspondences.
        mu: (N,) reliabilities (13).
        iterations: Upper limit; a step that is small against the pose's uncertainty ends the iteration.
        prior: Prediction whose rotation counts as an observation.

    Returns:
        The pose (4, 4) and its information (6, 6) in the camera's tangent [rotation; translation].
    """
    pose, information = world_T_camera, np.zeros((6, 6))
    for _ in range(iterations):
        residual, jacobian = linearise_projection(K, pose, matches.points, matches.uv_px, matches.lens)
        size = np.linalg.norm(residual, axis=1)
        weight = mu * np.minimum(1.0, _HUBER_PX / np.maximum(size, 1e-12))
        weighted = (weight[:, None, None] * jacobian).reshape(-1, 6)
        information = weighted.T @ jacobian.reshape(-1, 6)
        gradient = weighted.T @ residual.ravel()
        if prior is not None and prior.by_gyro:
            certainty = 0.5 / prior.rotation_sigma_rad**2
            off = gtsam.Rot3(prior.world_T_camera[:3, :3].T @ pose[:3, :3])
            gradient[:3] += certainty * gtsam.Rot3.Logmap(off)
            information[:3, :3] += certainty * np.eye(3)
        damped = information + np.diag(1e-9 * np.diag(information) + 1e-12)
        step = -np.linalg.solve(damped, gradient)
        pose = pose @ gtsam.Pose3.Expmap(np.clip(step, -1e3, 1e3)).matrix()
        if -(gradient @ step) < _SMALL_DECREASE:
            break
    return pose, 2.0 * information


def lmeds_pose(
    K: FloatArray,
    matches: Correspondences,
    guesses: FloatArray,
    samples: int,
    rng: np.random.Generator,
    good_px: float = 0.0,
) -> FloatArray:
    """Return the pose (4, 4) of least median squared reprojection error (A-3, Kume 2010).

    Minimal samples of three matches give up to four poses each (P3P), which compete with the ``guesses``. No
    samples are drawn if the median error of a guess is below ``good_px``.

    Args:
        K: (3, 3).
        matches: N >= 4 correspondences.
        guesses: (G, 4, 4) candidate poses, such as the motion model's.
        samples: Number of minimal samples.
        rng: Random generator for the samples.
        good_px: Median error with which a guess is accepted.
    """
    poses, median = np.asarray(guesses), _median_error(K, guesses, matches)
    if median.min() < good_px:
        return np.asarray(poses[int(median.argmin())])
    candidates = [*guesses]
    for _ in range(samples):
        sample = rng.choice(len(matches), 3, replace=False)
        count, rotations, translations = cv2.solveP3P(
            matches.points[sample], matches.uv_px[sample], K, None, flags=cv2.SOLVEPNP_AP3P
        )
        for rotation, translation in zip(rotations[:count], translations[:count], strict=True):
            candidates.append(_world_T_camera(cv2.Rodrigues(rotation)[0], translation[:, 0]))
    poses = np.array(candidates)
    return np.asarray(poses[int(np.argmin(_median_error(K, poses, matches)))])


def ransac_pose(
    K: FloatArray,
    matches: Correspondences,
    inlier_px: float,
    samples: int = _SAMPLES,
    confidence: float = _CONFIDENCE,
) -> FloatArray | None:
    """Return the pose (4, 4) with most inliers among those of minimal samples (P3P); None without one.

    Args:
        K: (3, 3).
        matches: N >= 4 correspondences, many of which may be wrong.
        inlier_px: Largest reprojection error of an inlier.
        samples: At most this many.
        confidence: With which one of them is free of outliers; fewer are drawn where that suffices.
    """
    # relative to their mean: world coordinates of hundreds of metres cost the solver precision
    mean = matches.points.mean(axis=0)
    try:
        ok, rotation, translation, inlier = cv2.solvePnPRansac(
            matches.points - mean,
            matches.uv_px,
            K,
            None,
            iterationsCount=samples,
            reprojectionError=inlier_px,
            confidence=confidence,
            flags=cv2.SOLVEPNP_AP3P,
        )
    except cv2.error:  # raised where points coincide or are collinear
        return None
    if not ok or inlier is None or not np.isfinite(translation).all():
        return None
    pose = _world_T_camera(cv2.Rodrigues(rotation)[0], translation[:, 0])
    pose[:3, 3] += mean
    return pose


def _median_error(K: FloatArray, poses: FloatArray, matches: Correspondences) -> FloatArray:
    """Return the median reprojection error (S,) in pixels of each pose (S, 4, 4)."""
    predicted, depth = project(K, poses, matches.points)
    squared = np.sum(in_picture(matches.lens, np.moveaxis(predicted - matches.uv_px, -1, 0)) ** 2, axis=0)
    squared[depth <= MIN_DEPTH] = np.inf
    return np.asarray(np.sqrt(np.median(squared, axis=1)))


def _world_T_camera(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> FloatArray:
    """Return the inverse of OpenCV's camera_T_world."""
    rotation, translation = np.asarray(rotation, np.float64), np.asarray(translation, np.float64)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ translation
    return pose

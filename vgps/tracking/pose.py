"""Pose of one frame from features of known position: robust by least median of squares (A-3), then (18)."""

import cv2
import gtsam
import numpy as np
import numpy.typing as npt

from vgps.geometry import MIN_DEPTH, linearise_projection, project
from vgps.model import FloatArray

_SMALL_DECREASE = 1e-6  # of the cost (18), in which being off by one standard deviation counts 1/2


def refine_pose(
    K: FloatArray,
    world_T_camera: FloatArray,
    points: FloatArray,
    uv_px: FloatArray,
    mu: FloatArray,
    huber_px: float = 1.0,
    iterations: int = 8,
) -> tuple[FloatArray, FloatArray]:
    """Minimise Eq. (18) of Kume 2010, ``sum_j mu_j rho(||q - q^||)``, over one pose by Gauss-Newton.

    Args:
        K: (3, 3).
        world_T_camera: (4, 4) start.
        points: (N, 3), ``uv_px``: (N, 2), ``mu``: (N,) reliabilities (13).
        huber_px: Errors beyond this grow linearly, so that one late outlier does not tilt the frame.
        iterations: At most so many steps; fewer once a step is nothing against the pose's uncertainty.

    Returns:
        The pose (4, 4) and its information (6, 6) in the camera's tangent [rotation; translation].
    """
    pose, information = world_T_camera, np.zeros((6, 6))
    for _ in range(iterations):
        residual, jacobian = linearise_projection(K, pose, points, uv_px)
        size = np.linalg.norm(residual, axis=1)
        weight = mu * np.minimum(1.0, huber_px / np.maximum(size, 1e-12))
        weighted = (weight[:, None, None] * jacobian).reshape(-1, 6)
        information = weighted.T @ jacobian.reshape(-1, 6)
        gradient = weighted.T @ residual.ravel()
        damped = information + np.diag(1e-9 * np.diag(information) + 1e-12)
        step = -np.linalg.solve(damped, gradient)
        pose = pose @ gtsam.Pose3.Expmap(np.clip(step, -1e3, 1e3)).matrix()
        if -(gradient @ step) < _SMALL_DECREASE:
            break
    return pose, 2.0 * information


def lmeds_pose(
    K: FloatArray,
    points: FloatArray,
    uv_px: FloatArray,
    guesses: FloatArray,
    samples: int,
    rng: np.random.Generator,
    good_px: float = 0.0,
) -> tuple[FloatArray, float]:
    """Pose of least median squared reprojection error (A-3, Kume 2010).

    Minimal samples of three matches each give up to four poses (P3P); they and the ``guesses`` compete. No
    samples are drawn when a guess already leaves a median below ``good_px``: most matches agree on it.

    Args:
        K: (3, 3).
        points: (N, 3), N >= 4, ``uv_px``: (N, 2).
        guesses: (G, 4, 4) poses that compete too, such as the motion model's.
        samples: Minimal samples drawn.
        rng: Source of the samples.

    Returns:
        The pose (4, 4) and the median error it leaves, in pixels.
    """
    poses, median = np.asarray(guesses), _median_error(K, guesses, points, uv_px)
    if median.min() < good_px:
        return poses[int(median.argmin())], float(median.min())
    candidates = [*guesses]
    for _ in range(samples):
        pick = rng.choice(len(points), 3, replace=False)
        count, rotations, translations = cv2.solveP3P(
            points[pick], uv_px[pick], K, None, flags=cv2.SOLVEPNP_AP3P
        )
        for rotation, translation in zip(rotations[:count], translations[:count], strict=True):
            candidates.append(_world_T_camera(cv2.Rodrigues(rotation)[0], translation[:, 0]))
    poses = np.array(candidates)
    median = _median_error(K, poses, points, uv_px)
    best = int(np.argmin(median))
    return poses[best], float(median[best])


def _median_error(K: FloatArray, poses: FloatArray, points: FloatArray, uv_px: FloatArray) -> FloatArray:
    """(S,) median reprojection error, pixels, of each pose (S, 4, 4)."""
    predicted, depth = project(K, poses, points)
    squared = np.sum((predicted - uv_px) ** 2, axis=-1)
    squared[depth <= MIN_DEPTH] = np.inf
    return np.asarray(np.sqrt(np.median(squared, axis=1)))


def _world_T_camera(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> FloatArray:
    """The inverse of OpenCV's camera_T_world."""
    rotation, translation = np.asarray(rotation, np.float64), np.asarray(translation, np.float64)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ translation
    return pose

"""Relative rotations of the camera between frames, with covariances, from the images alone.

Used to calibrate a gyro. No map is needed: the rotation of two views is determined whether or not the camera
also moves, and for a distant scene.
"""

from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from vgps.camera import undistort
from vgps.config import RotationConfig, TrackingConfig
from vgps.geometry.angular_rates import RelativeRotations
from vgps.model import Camera, FloatArray, Frame, GrayImage
from vgps.tracking.corners import new_corners
from vgps.tracking.epipolar_fit import TwoViews, fit_epipolar_geometry
from vgps.tracking.matching import make_matcher

_SHIFT_WIDTH_PX = 200  # approximate width to which images are reduced to find their shift
_ITERATIONS = 10  # a guard: from a fair start a few steps suffice


def frame_rotations(
    frames: Iterable[Frame],
    camera: Camera,
    tracking: TrackingConfig,
    rng: np.random.Generator,
    config: RotationConfig,
    *,
    min_interval_s: float = 0.0,
) -> RelativeRotations:
    """Return rotations between successive frames that lie at least ``min_interval_s`` apart."""
    matcher, rows, missed = make_matcher(tracking), [], 0
    for first, second in _pairs(frames, min_interval_s):
        uv = new_corners(first.gray, np.zeros((0, 2)), tracking.max_features, tracking, rng)
        shift = _shift(first.gray, second.gray, config.min_response)
        match = matcher.match(first.gray, second.gray, uv, uv + shift)
        pixels = [undistort(camera, uv[match.found]), undistort(camera, match.uv_px[match.found])]
        rotation = relative_rotation(camera.K, pixels[0], pixels[1], config)
        if rotation is None:
            missed += 1
        else:
            rows.append((first.t_s, second.t_s, *rotation))
    return RelativeRotations(
        start_s=np.array([row[0] for row in rows]),
        end_s=np.array([row[1] for row in rows]),
        start_R_end=np.array([row[2] for row in rows]).reshape(-1, 3, 3),
        covariance=np.array([row[3] for row in rows]).reshape(-1, 3, 3),
        missed=missed,
    )


def relative_rotation(
    K: FloatArray, first_px: FloatArray, second_px: FloatArray, config: RotationConfig
) -> tuple[FloatArray, FloatArray] | None:
    """Return the rotation between two views of one rigid scene, whether or not the camera moved.

    Args:
        K: (3, 3).
        first_px, second_px: (N, 2) the same features in both views, undistorted; rows with NaN are ignored.
        config: Limits of the matches.

    Returns:
        first_R_second (3, 3) and the covariance (3, 3) of its Log in the second camera's axes, marginal over
        the direction of motion; None if too few features agree.
    """
    good = np.isfinite(first_px).all(axis=1) & np.isfinite(second_px).all(axis=1)
    first_px, second_px = first_px[good], second_px[good]
    if len(first_px) < config.min_matches:
        return None
    rays = [(uv - K[:2, 2]) / (K[0, 0], K[1, 1]) for uv in (first_px, second_px)]
    first, second = (np.column_stack([xy, np.ones(len(xy))]) for xy in rays)
    views = TwoViews(first, second, float(np.sqrt(K[0, 0] * K[1, 1])))
    starts = [
        *_essential_matrix_starts(K, first_px, second_px, config.inlier_px),
        *_pure_rotation_starts(views, config.inlier_px),
    ]
    fits = [fit_epipolar_geometry(*start, views, config) for start in starts]
    best = min(fits, key=lambda fit: fit.cost)
    fit = fit_epipolar_geometry(best.second_R_first, best.direction, views, config, 2 * _ITERATIONS)
    rotation = fit.second_R_first
    if fit.inlier_share < config.min_inlier_share:
        return None
    return rotation.T, rotation @ fit.covariance @ rotation.T


def _pairs(frames: Iterable[Frame], min_interval_s: float) -> Iterator[tuple[Frame, Frame]]:
    previous: Frame | None = None
    for frame in frames:
        if previous is not None and frame.t_s - previous.t_s < min_interval_s:
            continue
        if previous is not None:
            yield previous, frame
        previous = frame


def _shift(first: GrayImage, second: GrayImage, min_response: float) -> FloatArray:
    """Return the shift (2,) of the whole image, which may exceed a matcher's search in a fast rotation."""
    factor = max(1, first.shape[1] // _SHIFT_WIDTH_PX)
    size = (first.shape[1] // factor, first.shape[0] // factor)
    a, b = (
        cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.float32) for gray in (first, second)
    )
    shift, response = cv2.phaseCorrelate(a, b, cv2.createHanningWindow(size, cv2.CV_32F))
    return factor * np.array(shift) if response > min_response else np.zeros(2)


def _essential_matrix_starts(
    K: FloatArray, first_px: FloatArray, second_px: FloatArray, inlier_px: float
) -> Iterator[tuple[FloatArray, FloatArray]]:
    essential, _ = cv2.findEssentialMat(
        first_px, second_px, K, method=cv2.USAC_MAGSAC, prob=0.9999, threshold=inlier_px
    )
    if essential is not None and essential.shape == (3, 3):
        *rotations, direction = cv2.decomposeEssentialMat(essential)
        # one of an essential matrix's two rotations includes half a revolution about the baseline
        yield np.asarray(max(rotations, key=np.trace), np.float64), np.asarray(direction[:, 0], np.float64)


def _pure_rotation_starts(views: TwoViews, inlier_px: float) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the robust rotation of a camera that does not move, with motion along each axis.

    In a narrow field of view a small sideways motion and a small rotation look alike, so that a search needs
    several starts.
    """
    a, b = (rays / np.linalg.norm(rays, axis=1)[:, None] for rays in (views.first, views.second))
    weight, rotation = np.ones(len(a)), np.eye(3)
    for _ in range(_ITERATIONS):
        rotation = Rotation.align_vectors(b, a, weights=weight)[0].as_matrix()
        error = np.linalg.norm(b - a @ rotation.T, axis=1) * views.focal_px
        weight = 1 / (1 + (error / max(float(np.median(error)), inlier_px)) ** 2)
    for direction in np.eye(3):
        yield rotation, direction

"""How the camera turns from frame to frame: rotations from the image alone, with their covariances.

Used to calibrate a gyro. No map is needed: an essential matrix holds the rotation whether or not the camera
moves, and between successive frames a far scene and a camera that only turns do no harm to it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import gtsam
import numpy as np
from scipy.spatial.transform import Rotation

from vgps.camera import undistort
from vgps.config import TrackingConfig
from vgps.model import BoolArray, Camera, FloatArray, Frame, GrayImage
from vgps.tracking.corners import new_corners
from vgps.tracking.matching import make_matcher

_INLIER_PX = 1.0
_MIN_MATCHES = 30
_MIN_SHARE = 0.5  # of matches that agree with one rigid scene
_SIGMA_FLOOR_PX = 0.05  # no matcher is better
_TRUSTED_RESPONSE = 0.05  # of phase correlation; noise gives less
_SHIFT_WIDTH = 200  # of the picture, roughly, in which its shift is looked for
_ITERATIONS = 10
_CONVERGED = 1e-6  # rad


@dataclass(frozen=True)
class RelativeRotations:
    """Rotations of the camera over P intervals of time.

    Attributes:
        start_s, end_s: (P,) times of the two frames.
        start_R_end: (P, 3, 3) from the camera's axes at the end to those at the start.
        covariance: (P, 3, 3) of ``Log`` of the rotation, camera's axes at the end, rad^2.
        missed: Intervals without a rotation: too few features, or no rigid scene.
    """

    start_s: FloatArray
    end_s: FloatArray
    start_R_end: FloatArray
    covariance: FloatArray
    missed: int

    def __len__(self) -> int:
        return len(self.start_s)

    def only(self, kept: BoolArray) -> "RelativeRotations":
        """The intervals (P,) that are kept; the others count as missed."""
        start, end = self.start_s[kept], self.end_s[kept]
        missed = self.missed + int((~kept).sum())
        return RelativeRotations(start, end, self.start_R_end[kept], self.covariance[kept], missed)


def frame_rotations(
    frames: Iterable[Frame],
    camera: Camera,
    config: TrackingConfig,
    rng: np.random.Generator,
    *,
    min_interval_s: float = 0.0,
) -> RelativeRotations:
    """Rotations between successive frames that lie at least ``min_interval_s`` apart."""
    matcher, rows, missed = make_matcher(config), [], 0
    for first, second in _pairs(frames, min_interval_s):
        uv = new_corners(first.gray, np.zeros((0, 2)), config.max_features, config, rng)
        match = matcher.match(first.gray, second.gray, uv, uv + _shift(first.gray, second.gray))
        flat = [undistort(camera, uv[match.found]), undistort(camera, match.uv_px[match.found])]
        turn = relative_rotation(camera.K, *flat)
        if turn is None:
            missed += 1
        else:
            rows.append((first.t_s, second.t_s, *turn))
    return RelativeRotations(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]).reshape(-1, 3, 3),
        np.array([row[3] for row in rows]).reshape(-1, 3, 3),
        missed,
    )


def relative_rotation(
    K: FloatArray, first_px: FloatArray, second_px: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Rotation between two views of one rigid scene, whether or not the camera moved.

    Args:
        K: (3, 3).
        first_px, second_px: (N, 2) the same features in both, undistorted; NaN is passed over.

    Returns:
        first_R_second (3, 3) and the covariance (3, 3) of its Log in the second camera's axes, with the
        direction of the motion, which the same features give, averaged out; None if too few agree.
    """
    good = np.isfinite(first_px).all(axis=1) & np.isfinite(second_px).all(axis=1)
    first_px, second_px = first_px[good], second_px[good]
    if len(first_px) < _MIN_MATCHES:
        return None
    rays = [(uv - K[:2, 2]) / (K[0, 0], K[1, 1]) for uv in (first_px, second_px)]
    first, second = (np.column_stack([xy, np.ones(len(xy))]) for xy in rays)
    focal = float(np.sqrt(K[0, 0] * K[1, 1]))
    starts = [*_by_essential_matrix(K, first_px, second_px), *_by_turning_alone(first, second, focal)]
    tried = [_refined(*start, first, second, focal) for start in starts]
    best = min(tried, key=lambda fit: fit.cost)
    fit = _refined(best.second_R_first, best.direction, first, second, focal, 2 * _ITERATIONS)
    rotation = fit.second_R_first
    return (rotation.T, rotation @ fit.covariance @ rotation.T) if fit.share >= _MIN_SHARE else None


def _pairs(frames: Iterable[Frame], min_interval_s: float) -> Iterator[tuple[Frame, Frame]]:
    previous: Frame | None = None
    for frame in frames:
        if previous is not None and frame.t_s - previous.t_s < min_interval_s:
            continue
        if previous is not None:
            yield previous, frame
        previous = frame


def _shift(first: GrayImage, second: GrayImage) -> FloatArray:
    """(2,) by how much the whole picture moved, which in a fast turn is more than a matcher looks for."""
    factor = max(1, first.shape[1] // _SHIFT_WIDTH)
    size = (first.shape[1] // factor, first.shape[0] // factor)
    a, b = (
        cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.float32) for gray in (first, second)
    )
    shift, response = cv2.phaseCorrelate(a, b, cv2.createHanningWindow(size, cv2.CV_32F))
    return factor * np.array(shift) if response > _TRUSTED_RESPONSE else np.zeros(2)


def _by_essential_matrix(
    K: FloatArray, first_px: FloatArray, second_px: FloatArray
) -> Iterator[tuple[FloatArray, FloatArray]]:
    essential, _ = cv2.findEssentialMat(
        first_px, second_px, K, method=cv2.USAC_MAGSAC, prob=0.9999, threshold=_INLIER_PX
    )
    if essential is not None and essential.shape == (3, 3):
        *rotations, direction = cv2.decomposeEssentialMat(essential)
        # of the two rotations of an essential matrix one has a half turn about the baseline in it
        yield np.asarray(max(rotations, key=np.trace), np.float64), np.asarray(direction[:, 0], np.float64)


def _by_turning_alone(
    first: FloatArray, second: FloatArray, focal_px: float
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """A camera that turns only, as most features have it, moving along each axis.

    A short way to the side and a small turn look alike in a narrow view: a search from one start ends in
    either.
    """
    a, b = (rays / np.linalg.norm(rays, axis=1)[:, None] for rays in (first, second))
    weight, rotation = np.ones(len(a)), np.eye(3)
    for _ in range(_ITERATIONS):
        rotation = Rotation.align_vectors(b, a, weights=weight)[0].as_matrix()
        off = np.linalg.norm(b - a @ rotation.T, axis=1) * focal_px
        weight = 1 / (1 + (off / max(float(np.median(off)), _INLIER_PX)) ** 2)
    for direction in np.eye(3):
        yield rotation, direction


class _Fit(NamedTuple):
    """Rotation, direction of the motion in the second's axes, covariance of the rotation in the first's axes,
    share of the features that agree, and cost between 0 and 1."""

    second_R_first: FloatArray
    direction: FloatArray
    covariance: FloatArray
    share: float
    cost: float


def _refined(
    second_R_first: FloatArray,
    direction: FloatArray,
    first: FloatArray,
    second: FloatArray,
    focal_px: float,
    iterations: int = 6,
) -> _Fit:
    """Least squares of the Sampson distance by rotation and direction; what is a pixel off hardly counts."""
    rotation, information, residual = second_R_first, np.eye(5), np.zeros(len(first))
    for _ in range(iterations):
        jacobian, residual = _sampson(rotation, direction, first, second, focal_px)
        weight = 1 / (1 + (residual / _INLIER_PX) ** 2)
        # a camera that only turns shows no direction; to a radian it is known in any case
        information = (weight[:, None] * jacobian).T @ jacobian + np.diag([0.0, 0.0, 0.0, 1.0, 1.0])
        information += 1e-9 * np.trace(information) * np.eye(5)
        step = -np.linalg.solve(information, jacobian.T @ (weight * residual))
        rotation = rotation @ Rotation.from_rotvec(step[:3]).as_matrix()
        direction = direction + _across(direction) @ step[3:]
        direction = direction / np.linalg.norm(direction)
        if np.abs(step).max() < _CONVERGED:
            break
    near = np.abs(residual) < _INLIER_PX
    behind = _behind(rotation, direction, first, second, focal_px)
    cost = np.where(behind, 1.0, np.minimum((residual / _INLIER_PX) ** 2, 1.0)).mean()
    sigma = max(1.4826 * float(np.median(np.abs(residual[near]))) if near.any() else 1.0, _SIGMA_FLOOR_PX)
    covariance = np.asarray(sigma**2 * np.linalg.inv(information)[:3, :3], np.float64)
    return _Fit(rotation, direction, covariance, float((near & ~behind).mean()), float(cost))


def _behind(
    rotation: FloatArray, direction: FloatArray, first: FloatArray, second: FloatArray, focal_px: float
) -> BoolArray:
    """(N,) whether a feature moved the wrong way along its line, as if it were behind the cameras."""
    turned = first @ rotation.T
    parallax = second[:, :2] - turned[:, :2] / turned[:, 2:]
    # second = turned + direction / depth, in the image
    outward = direction[:2] - direction[2] * second[:, :2]
    along = np.sum(parallax * outward, axis=1) / np.maximum(np.linalg.norm(outward, axis=1), 1e-12) * focal_px
    wrong = along < -2 * _INLIER_PX
    right = along > 2 * _INLIER_PX
    # the direction's sign is free
    return np.asarray(wrong if wrong.sum() < right.sum() else right)


def _sampson(
    rotation: FloatArray, direction: FloatArray, first: FloatArray, second: FloatArray, focal_px: float
) -> tuple[FloatArray, FloatArray]:
    """Distances (N,) in pixels from the epipolar lines, and (N, 5) by rotation (first's axes), direction."""
    turned = first @ rotation.T
    cross = gtsam.Rot3.Hat(direction)
    line = turned @ cross.T  # in the second image
    other = second @ cross @ rotation  # in the first
    scale = focal_px / np.maximum(np.hypot(np.hypot(*line[:, :2].T), np.hypot(*other[:, :2].T)), 1e-12)
    by_rotation = np.cross(first, other)
    by_direction = np.cross(turned, second) @ _across(direction)
    jacobian = np.hstack([by_rotation, by_direction]) * scale[:, None]
    return jacobian, np.sum(line * second, axis=1) * scale


def _across(direction: FloatArray) -> FloatArray:
    """(3, 2) two unit vectors at right angles to a direction and to each other."""
    return np.asarray(gtsam.Unit3(direction).basis())

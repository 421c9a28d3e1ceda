"""A frame as it is compared with others: described features, those beside landmarks with positions."""

from dataclasses import dataclass
from typing import IO

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vgps.camera import distort, undistort
from vgps.config.loops import LoopsConfig
from vgps.geometry import project, rays
from vgps.landmarks.descriptors import Descriptors, describe
from vgps.model import BoolArray, Camera, FloatArray, Frame, GrayImage, IntArray
from vgps.places.revisits import PosedVideo
from vgps.tracking.brightness import equally_bright
from vgps.tracking.corners import is_shown
from vgps.tracking.matching import pyramidal_flow
from vgps.tracking.pose import Correspondences, ransac_pose

_LK_WINDOW_PX = 21
_LK_LEVELS = 3
_LK_RETURN_PX = 0.5  # a landmark that is not found again where it came from is lost


@dataclass(frozen=True, kw_only=True)
class View:
    """A frame with its features and landmarks.

    Attributes:
        frame: Its number.
        gray: Its image.
        mask: (H, W) where it shows the scene; None for everywhere, and for an earlier view.
        uv_px: (N, 2) undistorted pixels of its features.
        descriptors: (N, 32) of them.
        near: (n,) features beside a landmark.
        points: (n, 3) their positions in the world, at the depth of the landmark.
        landmark: (m,) landmarks that the frame observes.
        raw_uv_px: (m, 2) where, in the distorted image.
    """

    frame: int
    gray: GrayImage
    mask: BoolArray | None
    uv_px: FloatArray
    descriptors: Descriptors
    near: IntArray
    points: FloatArray
    landmark: IntArray
    raw_uv_px: FloatArray


def make_view(frame: Frame, video: PosedVideo, config: LoopsConfig) -> View:
    """Describe the features of a frame, and place those beside landmarks."""
    uv, descriptors = described(frame, video.camera, config.features)
    rows = np.flatnonzero(video.observations.frame == frame.index)
    landmark, observed = video.observations.landmark[rows], video.observations.uv_px[rows]
    pose = video.poses[frame.index]
    _, depth = project(video.camera.K, pose, video.points[landmark])
    near, points = beside_landmarks(uv, observed, depth, video.camera.K, config.reach_px)
    return View(
        frame=frame.index,
        gray=frame.gray,
        mask=frame.mask,
        uv_px=uv,
        descriptors=descriptors,
        near=near,
        points=points @ pose[:3, :3].T + pose[:3, 3],
        landmark=landmark,
        raw_uv_px=distort(video.camera, observed),
    )


def described(frame: Frame, camera: Camera, features: int) -> tuple[FloatArray, Descriptors]:
    """Return the undistorted pixels (N, 2) of a frame's features, and their descriptors (N, 32)."""
    raw, descriptors = describe(frame.gray, features)
    uv = undistort(camera, raw)
    kept = np.isfinite(uv).all(axis=1) & is_shown(frame.mask, raw)
    return uv[kept], descriptors[kept]


def beside_landmarks(
    uv_px: FloatArray, observed_px: FloatArray, depth: FloatArray, K: FloatArray, reach_px: float
) -> tuple[IntArray, FloatArray]:
    """Return which features (N, 2) lie beside an observation (m, 2) of a landmark, and their positions (n, 3)
    in the camera's frame, at the depth (m,) of the landmark."""
    nearest: IntArray = np.full(len(uv_px), len(depth))
    if len(depth) and len(uv_px):
        nearest = np.asarray(cKDTree(observed_px).query(uv_px, distance_upper_bound=reach_px)[1])
    near = np.flatnonzero(nearest < len(depth))
    ray = rays(K, uv_px[near])
    return near, ray * (depth[nearest[near], None] / ray[:, 2:])


def on_disk(gray: GrayImage, file: IO[bytes]) -> GrayImage:
    """Append an image (H, W) to a file, and return it mapped from there, read-only."""
    start = file.seek(0, 2)
    file.write(np.ascontiguousarray(gray).tobytes())
    file.flush()
    return np.memmap(file, np.uint8, "r", offset=start, shape=gray.shape)


def matched(earlier: View, later: View, ratio: float) -> Correspondences:
    """Return the placed features of an earlier view, and where a later one has such descriptors."""
    placed = earlier.descriptors[earlier.near]
    return correspondences(placed, earlier.points, later.descriptors, later.uv_px, ratio)


def correspondences(
    placed: Descriptors, points: FloatArray, descriptors: Descriptors, uv_px: FloatArray, ratio: float
) -> Correspondences:
    """Return which of the points (n, 3) with these descriptors match features (N, 2) of a frame."""
    if len(placed) < 2 or len(descriptors) < 2:
        return Correspondences(np.zeros((0, 3)), np.zeros((0, 2)))
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(placed, descriptors, k=2)
    good = [best for best, second in pairs if best.distance < ratio * second.distance]
    return Correspondences(points[[one.queryIdx for one in good]], uv_px[[one.trainIdx for one in good]])


def agreed_pose(
    K: FloatArray, matches: Correspondences, config: LoopsConfig
) -> tuple[FloatArray, Correspondences] | None:
    """Return the pose (4, 4) on which most matches agree, and these; None if there are too few of them."""
    if len(matches) < config.min_inliers:
        return None
    pose = ransac_pose(K, matches, config.inlier_px)
    if pose is None:
        return None
    agree = matches.where(matches.inliers(K, pose, config.inlier_px))
    return (pose, agree) if len(agree) >= config.min_inliers else None


def followed(
    earlier: View, later: View, world_T_camera: FloatArray, video: PosedVideo
) -> tuple[IntArray, FloatArray]:
    """Find the landmarks of an earlier view in the image of a later one whose pose is roughly known.

    Lucas and Kanade's method starts at their projections, and must lead back.

    Returns:
        The rows (n,) of the view's landmarks that should be in the image, and (n, 2) where they are found in
        the distorted image, NaN where not.
    """
    uv, depth = project(video.camera.K, world_T_camera, video.points[earlier.landmark])
    start = distort(video.camera, uv)
    size = np.array(later.gray.shape[::-1])
    inside = np.all((start > 0) & (start < size), axis=1) & is_shown(later.mask, start)
    rows = np.flatnonzero((depth > 0) & inside)
    if not len(rows):
        return rows, np.zeros((0, 2))
    before, guess = (x[rows].astype(np.float32)[:, None] for x in (earlier.raw_uv_px, start))
    images = equally_bright(earlier.gray, later.gray)
    there, found, _ = pyramidal_flow(images, before, guess, _LK_WINDOW_PX, _LK_LEVELS)
    back, again, _ = pyramidal_flow(images[::-1], there, before, _LK_WINDOW_PX, _LK_LEVELS)
    good = found & again & (np.linalg.norm(back - before, axis=2)[:, 0] < _LK_RETURN_PX)
    raw = there[:, 0].astype(np.float64)
    good &= is_shown(later.mask, raw)
    return rows, np.where(good[:, None], raw, np.nan)

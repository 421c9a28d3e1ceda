"""Keyframes: features of a frame, attached to the landmarks beside them."""

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vgps.config import LandmarksConfig
from vgps.geometry import rays
from vgps.landmarks.descriptors import describe
from vgps.landmarks.model import Keyframe
from vgps.landmarks.observation_selection import LandmarkObservations
from vgps.model import BoolArray, Camera, FloatArray, GrayImage, IntArray


def keyframe_rows(usable: BoolArray, every: int) -> IntArray:
    """Return the first usable frame of every ``every`` frames of a video; ``usable`` (F,)."""
    rows = np.flatnonzero(usable)
    return np.asarray(rows[np.unique(rows // every, return_index=True)[1]])


def make_keyframe(
    gray: GrayImage,
    camera: Camera,
    world_T_camera: FloatArray,
    observed: LandmarkObservations,
    config: LandmarksConfig,
) -> Keyframe:
    """Build a keyframe from the features that lie beside landmarks.

    A feature is placed where its ray reaches its landmark's depth.

    Args:
        gray: (H, W) undistorted.
        camera: Its K.
        world_T_camera: (4, 4).
        observed: The landmarks in it, in front of the camera.
        config: Number of features, distance from a feature to its landmark, and width of the thumbnail.
    """
    uv, descriptors = describe(gray, config.keyframe_features)
    feature, row = _nearest_landmarks(uv, observed.uv_px, config.keyframe_reach_px)
    order = np.lexsort((feature, observed.landmark[row]))
    feature, beside = feature[order], observed.take(row[order])
    ray = rays(camera.K, uv[feature])
    points = ray * (beside.depth_m[:, None] / ray[:, 2:])
    rotation, centre = beside.world_T_camera[:, :3, :3], beside.world_T_camera[:, :3, 3]
    width = config.thumbnail_px
    height = max(1, round(width * camera.height / camera.width))
    return Keyframe(
        world_T_camera=world_T_camera,
        landmark=beside.landmark,
        world_p_landmark=np.einsum("nij,nj->ni", rotation, points) + centre,
        descriptors=descriptors[feature],
        thumbnail=np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA), np.uint8),
    )


def _nearest_landmarks(uv: FloatArray, uv_landmark: FloatArray, reach_px: float) -> tuple[IntArray, IntArray]:
    """Return the features (N, 2) within reach of a landmark (M, 2), and the nearest landmark of each."""
    if not len(uv_landmark):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    distance, nearest = cKDTree(uv_landmark).query(uv)
    feature = np.flatnonzero(distance <= reach_px)
    return feature, np.asarray(nearest, np.int64)[feature]

"""Keyframes: features of a frame, attached to the landmarks beside them."""

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vgps.config import LandmarksConfig
from vgps.geometry import project, rays
from vgps.landmarks.descriptors import describe
from vgps.landmarks.model import Keyframe
from vgps.model import BoolArray, Camera, FloatArray, GrayImage, IntArray


def keyframe_rows(usable: BoolArray, every: int) -> IntArray:
    """Return the first usable frame of every ``every`` frames of a video; ``usable`` (F,)."""
    rows = np.flatnonzero(usable)
    return np.asarray(rows[np.unique(rows // every, return_index=True)[1]])


def make_keyframe(
    gray: GrayImage,
    camera: Camera,
    world_T_camera: FloatArray,
    landmark: IntArray,
    world_p_landmark: FloatArray,
    config: LandmarksConfig,
) -> Keyframe:
    """Build a keyframe from the features that lie beside landmarks.

    A feature is placed where its ray reaches its landmark's depth.

    Args:
        gray: (H, W) undistorted.
        camera: Its K.
        world_T_camera: (4, 4).
        landmark: (N,) ids of landmarks observed in it.
        world_p_landmark: (N, 3) their positions, in front of the camera.
        config: Number of features, distance from a feature to its landmark, and width of the thumbnail.
    """
    rotation, centre = world_T_camera[:3, :3], world_T_camera[:3, 3]
    uv_landmark, depth_m = project(camera.K, world_T_camera, world_p_landmark)
    uv, descriptors = describe(gray, config.keyframe_features)
    feature, row = _nearest_landmarks(uv, uv_landmark, config.keyframe_reach_px)
    order = np.lexsort((feature, landmark[row]))
    feature, row = feature[order], row[order]
    ray = rays(camera.K, uv[feature])
    points = ray * (depth_m[row, None] / ray[:, 2:])
    width = config.thumbnail_px
    height = max(1, round(width * camera.height / camera.width))
    return Keyframe(
        world_T_camera=world_T_camera,
        landmark=landmark[row],
        world_p_landmark=points @ rotation.T + centre,
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

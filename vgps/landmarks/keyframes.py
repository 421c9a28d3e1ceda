"""Keyframes: what a frame's features look like, tied to the landmarks beside them."""

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vgps.geometry import project, rays
from vgps.landmarks.descriptors import KEYFRAME_FEATURES, describe
from vgps.landmarks.model import Keyframe
from vgps.model import BoolArray, Camera, FloatArray, GrayImage, IntArray


def keyframe_rows(usable: BoolArray, every: int) -> IntArray:
    """The first usable frame of every ``every`` frames of a video; ``usable`` (F,)."""
    rows = np.flatnonzero(usable)
    return np.asarray(rows[np.unique(rows // every, return_index=True)[1]])


def make_keyframe(
    gray: GrayImage,
    camera: Camera,
    world_T_camera: FloatArray,
    landmark: IntArray,
    world_p_landmark: FloatArray,
    *,
    reach_px: float,
    thumbnail_px: int,
) -> Keyframe:
    """A keyframe of features that lie beside landmarks.

    A feature is put where its ray meets its landmark's depth.

    Args:
        gray: (H, W) undistorted.
        camera: Its K.
        world_T_camera: (4, 4).
        landmark: (N,) ids of landmarks seen in it, ``world_p_landmark`` (N, 3) in front of the camera.
        reach_px: How far a feature may lie from the landmark's projection.
        thumbnail_px: Width of the thumbnail.
    """
    rotation, centre = world_T_camera[:3, :3], world_T_camera[:3, 3]
    uv_landmark, depth_m = project(camera.K, world_T_camera, world_p_landmark)
    uv, descriptors = describe(gray, KEYFRAME_FEATURES)
    feature, row = _beside(uv, uv_landmark, reach_px)
    order = np.lexsort((feature, landmark[row]))
    feature, row = feature[order], row[order]
    ray = rays(camera.K, uv[feature])
    points = ray * (depth_m[row, None] / ray[:, 2:])
    height = max(1, round(thumbnail_px * camera.height / camera.width))
    return Keyframe(
        world_T_camera=world_T_camera,
        landmark=landmark[row],
        world_p_landmark=points @ rotation.T + centre,
        descriptors=descriptors[feature],
        thumbnail=np.asarray(
            cv2.resize(gray, (thumbnail_px, height), interpolation=cv2.INTER_AREA), np.uint8
        ),
    )


def _beside(uv: FloatArray, uv_landmark: FloatArray, reach_px: float) -> tuple[IntArray, IntArray]:
    """Features (N, 2) within reach of a landmark (M, 2), and the nearest landmark of each."""
    if not len(uv_landmark):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    distance, nearest = cKDTree(uv_landmark).query(uv)
    feature = np.flatnonzero(distance <= reach_px)
    return feature, np.asarray(nearest, np.int64)[feature]

"""The motions of a camera between two views of a plane: there are two, and more views show which is wrong.

The homography ``R + t n^T / d`` of a plane with normal n is that of another rotation with about t and n in
each other's places (Longuet-Higgins, The Reconstruction of a Plane Surface from Two Perspective Projections,
1986). So the essential matrix of a drone's ground may be that of a wall that the camera falls along.
"""

import cv2
import numpy as np

from vgps.model import FloatArray

_MIN_SHARE = 0.5  # of the features lie on the plane
_NO_MOTION = 1e-6  # in distances of the plane


def poses_over_plane(
    K: FloatArray, first_px: FloatArray, last_px: FloatArray, limit_px: float
) -> list[FloatArray]:
    """Return the poses (4, 4) of a last view in the first, with a unit baseline, if both show a plane.

    Args:
        K: (3, 3) calibration matrix.
        first_px, last_px: (N, 2) undistorted pixels of the features.
        limit_px: Features on the plane fit its homography to this.
    """
    homography, on_plane = cv2.findHomography(first_px, last_px, cv2.RANSAC, limit_px)
    if homography is None or np.mean(on_plane) < _MIN_SHARE:
        return []
    _, rotations, translations, _ = cv2.decomposeHomographyMat(homography, K)
    poses = []
    for rotation, translation in zip(rotations, translations, strict=True):
        length = float(np.linalg.norm(translation))
        if length > _NO_MOTION:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ translation[:, 0] / length
            poses.append(pose)
    return poses

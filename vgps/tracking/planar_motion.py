"""The motions of a camera between two views of a plane: there are two, and more views show which is wrong.

The homography ``R + t n^T / d`` of a plane with normal n is that of another rotation with about t and n in
each other's places (Longuet-Higgins, The Reconstruction of a Plane Surface from Two Perspective Projections,
1986). So the essential matrix of a drone's ground may be that of a wall that the camera falls along.
"""

import cv2
import numpy as np

from vgps.geometry import rays
from vgps.model import FloatArray

_MIN_SHARE = 0.5  # of the features lie on the plane
_NO_MOTION = 1e-6  # in distances of the plane
_FOCAL_SCALES = np.linspace(0.8, 1.2, 21)  # of the camera's, which may be a guess


def poses_over_plane(
    K: FloatArray, first_px: FloatArray, last_px: FloatArray, limit_px: float
) -> list[FloatArray]:
    """Return the poses (4, 4) of a last view in the first, with a unit baseline, if both show a plane.

    They show none where a turn on the spot, with whatever focal length, explains them as well.

    Args:
        K: (3, 3) calibration matrix.
        first_px, last_px: (N, 2) undistorted pixels of the features.
        limit_px: Features on the plane fit its homography to this.
    """
    homography, on_plane = cv2.findHomography(first_px, last_px, cv2.RANSAC, limit_px)
    if homography is None or np.mean(on_plane) < _MIN_SHARE:
        return []
    seen = on_plane.ravel() > 0
    if _turns(K, np.asarray(homography, np.float64), first_px[seen], last_px[seen], limit_px):
        return []
    _, *motions = cv2.decomposeHomographyMat(homography, K)
    ray = rays(K, first_px[seen]).mean(axis=0)
    poses = []
    for rotation, translation, normal in zip(*motions, strict=True):
        length = float(np.linalg.norm(translation))
        if length > _NO_MOTION and ray @ normal[:, 0] > 0.0:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ translation[:, 0] / length
            poses.append(pose)
    return poses


def _turns(
    K: FloatArray, homography: FloatArray, first_px: FloatArray, last_px: FloatArray, limit_px: float
) -> bool:
    """Return whether most features fit the rotation that is nearest to a homography, at one focal length."""
    for scale in _FOCAL_SCALES:
        scaled = K @ np.diag([scale, scale, 1.0])
        u, _, vt = np.linalg.svd(np.linalg.solve(scaled, homography @ scaled))
        rotation = u @ vt * np.linalg.det(u @ vt)
        turned = rays(scaled, first_px) @ (scaled @ rotation).T
        if np.median(np.linalg.norm(turned[:, :2] / turned[:, 2:] - last_px, axis=1)) < limit_px:
            return True
    return False

"""The land under a camera that flies: the plane of most landmarks, seen from above, is roughly level.

A straight path does not show the rotation about itself, and a drone's camera may look anywhere from ahead to
straight down, so no prior of its pitch tells it either.
"""

import numpy as np

from vgps.model import FloatArray

_TRIALS = 300  # planes through three landmarks
_TOLERANCE = 0.06  # of landmarks on the plane, over the camera's distance from it: houses and trees are lower
_MIN_SHARE = 0.6  # of the landmarks lie on it
_MIN_LANDMARKS = 30
_REFINED = 5


def land_normal(points: FloatArray, centres: FloatArray) -> FloatArray | None:
    """Return the normal (3,) of the plane of most landmarks towards the camera, or None if there is none.

    Args:
        points: (L, 3) landmarks; those that are NaN have no position.
        centres: (F, 3) positions of the camera.
    """
    points, centre = points[np.isfinite(points).all(axis=1)], centres.mean(axis=0)
    if len(points) < _MIN_LANDMARKS:
        return None
    three = points[np.random.default_rng(0).integers(0, len(points), (_TRIALS, 3))]
    normals = np.cross(three[:, 1] - three[:, 0], three[:, 2] - three[:, 0])
    length = np.linalg.norm(normals, axis=1)
    if not length.any():
        return None
    normals, through = normals[length > 0.0] / length[length > 0.0, None], three[length > 0.0, 0]
    height = np.sum((centre - through) * normals, axis=1)
    off = np.abs(points @ normals.T - np.sum(through * normals, axis=1))
    on = off < _TOLERANCE * np.abs(height)
    best = int(np.argmax(on.sum(axis=0)))
    chosen, normal = on[:, best], normals[best]
    for _ in range(_REFINED):
        if np.mean(chosen) < _MIN_SHARE:
            return None
        middle = points[chosen].mean(axis=0)
        normal = np.linalg.svd(points[chosen] - middle, full_matrices=False)[2][2]
        chosen = np.abs((points - middle) @ normal) < _TOLERANCE * abs((centre - middle) @ normal)
    return np.asarray(normal * np.sign((centre - points[chosen].mean(axis=0)) @ normal))

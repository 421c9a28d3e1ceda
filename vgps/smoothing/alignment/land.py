"""The land under a camera that flies: the plane of most landmarks, seen from above, is roughly level.

A straight path does not show the rotation about itself, and a drone's camera may look anywhere from ahead to
straight down, so no prior of its pitch determines it either.
"""

import numpy as np

from vgps.model import FloatArray

_TRIALS = 300  # planes through three landmarks
_TOLERANCE = 0.06  # of landmarks on the plane, over the camera's distance from it: houses and trees are lower
_MIN_SHARE = 0.6  # of the landmarks lie on it
_MIN_LANDMARKS = 30
_MOST_LANDMARKS = 2000  # more of them are thinned out
_MIN_SPREAD = (
    0.1  # of those on the plane, over that distance: a row of them, or a narrow view, shows no slope
)
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
    points = points[:: 1 + len(points) // _MOST_LANDMARKS]
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
    chosen = on[:, best]
    for _ in range(_REFINED):
        if np.mean(chosen) < _MIN_SHARE:
            return None
        middle = points[chosen].mean(axis=0)
        _, extent, axes = np.linalg.svd(points[chosen] - middle, full_matrices=False)
        distance = float((centre - middle) @ axes[2])
        if extent[1] < _MIN_SPREAD * abs(distance) * np.sqrt(chosen.sum()):
            return None
        chosen = np.abs((points - middle) @ axes[2]) < _TOLERANCE * abs(distance)
    return np.asarray(np.copysign(1.0, distance) * axes[2])

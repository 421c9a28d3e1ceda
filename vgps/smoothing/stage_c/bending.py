"""By how much the path of a window may be bent: the growth of the covariance of its rotations.

With little parallax, or where a camera moves away from a plane, as a drone that climbs over flat ground,
rotation and motion are hard to tell apart: the first seconds of a map bend by degrees, and features fit no
worse.
"""

from dataclasses import replace

import numpy as np

from vgps.errors import GeometryError
from vgps.geometry import travelled
from vgps.model import FloatArray
from vgps.solver.marginals import marginal_covariances
from vgps.solver.problem import BundleProblem

_FIRST_VIEWS = 10  # of a map, among which the one is held that gives the scale


def farthest_of_first_views(poses: FloatArray) -> int:
    """Return which view of a map (F, 4, 4) is held beside its first one, and so gives the scale."""
    away = np.linalg.norm(poses[:_FIRST_VIEWS, :3, 3] - poses[0, :3, 3], axis=1)
    return int(np.argmax(away))


def bending_of(solved: BundleProblem) -> FloatArray:
    """Return the variance (F,), rad^2 about each axis, by which a rotation may err more than the one before.

    The last frame that is held errs by nothing; in a map that begins in the window, the first and the one
    that gives the scale are held. A path that may stray farther than its rotations say has larger ones: if
    the rotation walks at random, the variance of the end across the path, over the square of its length, is
    a third of the variance of the last rotation.

    Args:
        solved: The window at its optimum.

    Returns:
        NaN up to the last frame that is held, and everywhere if observations do not determine the poses.
    """
    poses, held = solved.world_T_camera, solved.fixed_frames.copy()
    out = np.full(len(poses), np.nan)
    if not held.any():
        held[[0, farthest_of_first_views(poses)]] = True
    last = int(np.flatnonzero(held)[-1])
    if last + 1 >= len(poses):
        return out
    try:
        covariance = marginal_covariances(replace(solved, fixed=held)).poses[last + 1 :]
    except GeometryError:
        return out
    variance = np.trace(covariance[:, :3, :3], axis1=1, axis2=2) / 3.0
    aside = _variance_aside(poses[last:], covariance[-1, 3:, 3:])
    variance *= max(1.0, 3.0 * aside / max(variance[-1], 1e-12))
    out[last + 1 :] = np.diff(np.maximum.accumulate(variance), prepend=0.0)
    return out


def _variance_aside(poses: FloatArray, covariance: FloatArray) -> float:
    """Return the variance across a path (n, 4, 4) of its end's position, over the path's length."""
    chord = poses[-1, :3, :3].T @ (poses[-1, :3, 3] - poses[0, :3, 3])
    along = chord / max(float(np.linalg.norm(chord)), 1e-12)
    length = float(travelled(poses[:, :3, 3])[-1])
    across = 0.5 * (np.trace(covariance) - along @ covariance @ along)
    return float(across) / max(length, 1e-12) ** 2

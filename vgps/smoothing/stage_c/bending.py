"""By how much the path of a window may be bent: the growth of the covariance of its rotations.

With little parallax, or where a camera moves away from a plane, as a drone that climbs over flat ground,
rotation and motion are hard to tell apart: the first seconds of a map bend by degrees, and features fit no
worse.
"""

from dataclasses import replace

import gtsam
import numpy as np

from vgps.errors import GeometryError
from vgps.geometry import travelled
from vgps.model import FloatArray
from vgps.smoothing.stage_c.held_scale import held_distance
from vgps.solver.marginals import marginal_covariances
from vgps.solver.problem import BundleProblem

_UNKNOWN = 1.0  # rad^2, beyond which a linear variance says nothing more


def bending_of(solved: BundleProblem) -> FloatArray:
    """Return the variance (F,), rad^2 about each axis, by which a rotation may err more than the one before.

    The last frame that is held errs by nothing, or the first one of a map that begins in the window; where
    the last frame lies is known but for its direction, as the scale is no part of the shape. A path that may
    bend more than its rotations say has larger ones.

    Args:
        solved: The window at its optimum, its poses with the keys ``x0``, ``x1``, ...

    Returns:
        NaN up to the last frame that is held, and everywhere if observations do not determine the poses.
    """
    poses, held = solved.world_T_camera, solved.fixed_frames.copy()
    out = np.full(len(poses), np.nan)
    if not held.any():
        held[0] = True
    base, end = int(np.flatnonzero(held)[-1]), len(poses) - 1
    scale = held_distance(poses, base, end)
    if not scale.size():
        return out
    graph = gtsam.NonlinearFactorGraph(solved.pose_graph)
    graph.push_back(scale)
    try:
        covariance = marginal_covariances(replace(solved, fixed=held, pose_graph=graph)).poses[base + 1 :]
    except GeometryError:
        return out
    variance = np.trace(covariance[:, :3, :3], axis1=1, axis2=2) / 3.0
    bends = _bend_of_path(poses[base:], covariance[:, 3:, 3:])
    variance *= max(1.0, bends / max(variance[-1], 1e-12))
    out[base + 1 :] = np.diff(np.maximum.accumulate(np.minimum(variance, _UNKNOWN)), prepend=0.0)
    return out


def _bend_of_path(poses: FloatArray, covariance: FloatArray) -> float:
    """Return the variance, rad^2 about each axis, by which a path bends up to its end.

    A rotation that walks at random takes the end aside by ``length^2 / 3`` times this, and its middle by an
    eighth of that; noise of the positions takes both aside alike.

    Args:
        poses: (n, 4, 4) from the one that is held on.
        covariance: (n - 1, 3, 3) of the positions after it, in the axes of the cameras.
    """
    along = travelled(poses[:, :3, 3])
    middle = max(int(np.searchsorted(along, 0.5 * along[-1])), 1)
    chord = poses[-1, :3, 3] - poses[0, :3, 3]
    chord /= np.linalg.norm(chord)
    rows = np.array([middle, len(along) - 1])
    axis = chord @ poses[rows, :3, :3]
    spread = covariance[rows - 1]
    aside = 0.5 * (np.trace(spread, axis1=1, axis2=2) - np.einsum("ni,nij,nj->n", axis, spread, axis))
    return float(4.0 * max(aside[1] - 2.0 * aside[0], 0.0) / along[-1] ** 2)

"""The scale of a map that nothing ties to the world: the distance between two of its frames is held.

The frames themselves are not: the pose of a second frame is an estimate of two views, which may be wrong by
degrees, and one that is held bends all that follows.
"""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.model import FloatArray

_SIGMA = 1e-3  # of the distance


def held_distance(poses: FloatArray, base: int, end: int, first: int = 0) -> gtsam.NonlinearFactorGraph:
    """Return a factor that holds the distance between two frames, or none if they are at one place.

    Args:
        poses: (F, 4, 4).
        base, end: Rows of the two frames.
        first: Number of the frame in the first row, in its key.
    """
    graph = gtsam.NonlinearFactorGraph()
    if distance := float(np.linalg.norm(poses[end, :3, 3] - poses[base, :3, 3])):
        sigma = gtsam.noiseModel.Isotropic.Sigma(1, _SIGMA * distance)
        graph.push_back(gtsam.RangeFactorPose3(X(first + base), X(first + end), distance, sigma))
    return graph

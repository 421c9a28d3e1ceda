"""Poses and vectors of a problem as GTSAM's values, and back."""

import gtsam
import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.problem import BundleProblem
from vgps.solver.state_vectors import StateVector


def pose_values(problem: BundleProblem) -> gtsam.Values:
    """Return the poses that occur in ``pose_graph``, the shared vectors and the states."""
    return _values(problem, problem.pose_graph_frames)


def all_pose_values(problem: BundleProblem) -> gtsam.Values:
    """Return every pose, whether or not it occurs in ``pose_graph``, the shared vectors and the states."""
    return _values(problem, np.arange(len(problem.world_T_camera)))


def _values(problem: BundleProblem, frames: IntArray) -> gtsam.Values:
    values = gtsam.Values()
    for key, vector in problem.shared.items():
        values.insert(key, vector)
    for key, state in problem.states.items():
        state.insert_into(values, key)
    for key, world_T_camera in zip(
        problem.keys[frames].tolist(), problem.world_T_camera[frames], strict=True
    ):
        values.insert(key, gtsam.Pose3(world_T_camera))
    return values


def vectors_at(
    values: gtsam.Values, problem: BundleProblem
) -> tuple[dict[int, FloatArray], dict[int, StateVector]]:
    """Return the shared vectors and the states of a problem, with their values in ``values``."""
    shared = {key: values.atVector(key) for key in problem.shared}
    return shared, {key: state.read_from(values, key) for key, state in problem.states.items()}

"""An iterate of the optimiser: a problem at its current values with its cost, and the one after a step."""

from collections.abc import Mapping
from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.gtsam_values import all_pose_values, vectors_at
from vgps.solver.landmark_refinement import anchor_frames, landmark_costs, step_landmarks
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True)
class Iterate:
    """A problem at its current values.

    Attributes:
        problem: The problem.
        values: All but its landmarks as GTSAM values.
        video: Cost of the observations.
        poses: Cost of the pose factors.
        anchor: (L,) from :func:`~vgps.solver.landmark_refinement.anchor_frames`.
    """

    problem: BundleProblem
    values: gtsam.Values
    video: float
    poses: float
    anchor: IntArray

    @property
    def cost(self) -> float:
        """The whole cost."""
        return self.video + self.poses

    @property
    def cost_terms(self) -> Mapping[str, float]:
        """Its terms, as :func:`vgps.solver.cost.cost_terms` names them."""
        return {"video": self.video, "poses": self.poses}


@dataclass(frozen=True)
class Step:
    """Steps of poses and states (6 n_free,), landmarks (L, 3) and shared vectors (s,).

    ``predicted`` is the decrease of the cost in the linear model.
    """

    reduced: FloatArray
    landmarks: FloatArray
    shared: FloatArray
    predicted: float


def iterate_at(problem: BundleProblem, structure: SparsityStructure) -> Iterate:
    """Return the iterate at the values that a problem has."""
    values = all_pose_values(problem)
    (video,) = landmark_costs(problem, structure, problem.world_p_landmark)
    poses = float(problem.pose_graph.error(values))
    return Iterate(problem, values, float(video.sum()), poses, anchor_frames(problem))


def retract(iterate: Iterate, structure: SparsityStructure, step: Step, fraction: float) -> Iterate:
    """Return the iterate after a fraction of a step."""
    before, delta = iterate.problem, gtsam.VectorValues()
    moves, reduced = structure.free >= 0, fraction * step.reduced
    for key, pose_step in zip(before.keys[moves].tolist(), structure.to_frames(reduced)[moves], strict=True):
        delta.insert(key, pose_step)
    for key, place in structure.states.items():
        start = POSE_DIM * place
        delta.insert(key, reduced[start : start + len(before.states[key].vector)])
    at = 0
    for key in sorted(before.shared):
        size = len(before.shared[key])
        delta.insert(key, fraction * step.shared[at : at + size])
        at += size
    values = iterate.values.retract(delta)
    problem = before.moved(_poses(values, before), before.world_p_landmark, *vectors_at(values, before))
    landmarks, video = step_landmarks(problem, before, iterate.anchor, fraction * step.landmarks, structure)
    problem = problem.moved(problem.world_T_camera, landmarks)
    return Iterate(problem, values, video, float(problem.pose_graph.error(values)), iterate.anchor)


def _poses(values: gtsam.Values, before: BundleProblem) -> FloatArray:
    """Return the poses (F, 4, 4) of the values; held poses stay unchanged to the last bit."""
    rows = np.empty((len(before.world_T_camera), 12))
    rows[np.argsort(before.keys)] = gtsam.utilities.extractPose3(values)  # in ascending order of keys
    world_T_camera = before.world_T_camera.copy()
    free = ~before.fixed_frames
    world_T_camera[free, :3, :3] = rows[free, :9].reshape(-1, 3, 3)
    world_T_camera[free, :3, 3] = rows[free, 9:]
    return world_T_camera

"""A short drive whose fixes have a wandering offset, and whose camera has a bias: states beside the poses."""

from collections.abc import Sequence
from dataclasses import replace

import gtsam
import numpy as np
from gtsam.noiseModel import mEstimator
from gtsam.symbol_shorthand import A, B, O, X
from synthetic_bundle import drive, held_frames

from vgps.model import FloatArray
from vgps.solver.problem import BundleProblem
from vgps.solver.state_vectors import StateVector

EVERY = 5  # frames that share an offset
WALK_M = 0.05  # of the offset from one state to the next


def offset_fix(frame: int, world_p_fix: FloatArray, every: int = EVERY) -> gtsam.CustomFactor:
    """A fix of the camera with an offset that ``every`` frames share."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: Sequence | None) -> FloatArray:
        pose, offset = values.atPose3(X(frame)), values.atVector(this.keys()[1])
        if jacobians is not None:
            jacobians[0] = np.asfortranarray(np.hstack([np.zeros((3, 3)), pose.rotation().matrix()]))
            jacobians[1] = np.asfortranarray(np.eye(3))
        return pose.translation() + offset - world_p_fix

    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.05)
    return gtsam.CustomFactor(noise, [X(frame), O(frame // every)], error)


def turned_by(frame: int, key: int, tangent: FloatArray) -> gtsam.CustomFactor:
    """A factor (6,) on a pose and a bias of its rotation and translation, which is not linear in the pose."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: Sequence | None) -> FloatArray:
        pose = values.atPose3(X(frame))
        if jacobians is not None:
            jacobians[0] = np.asfortranarray(gtsam.Pose3.LogmapDerivative(pose))
            jacobians[1] = np.eye(6, order="F")
        return gtsam.Pose3.Logmap(pose) + values.atVector(key) - tangent

    return gtsam.CustomFactor(gtsam.noiseModel.Isotropic.Sigma(6, 0.3), [X(frame), key], error)


def walk(states: int, robust: bool) -> gtsam.NonlinearFactorGraph:
    """Return the chain of offsets; Cauchy's loss is that of Student's t up to the weight of small errors."""
    graph = gtsam.NonlinearFactorGraph()
    noise: gtsam.noiseModel.Base = gtsam.noiseModel.Isotropic.Sigma(3, WALK_M)
    if robust:
        noise = gtsam.noiseModel.Robust.Create(mEstimator.Cauchy.Create(1.0), noise)
    for k in range(states - 1):
        graph.push_back(gtsam.BetweenFactorPoint3(O(k), O(k + 1), np.zeros(3), noise))
    graph.addPriorPoint3(O(0), np.zeros(3), gtsam.noiseModel.Isotropic.Sigma(3, 0.2))
    return graph


def offset_fixes(frames: int, poses: FloatArray, seed: int = 0) -> gtsam.NonlinearFactorGraph:
    """Return a fix every second frame, with an offset that wanders and once jumps by half a metre."""
    rng, graph = np.random.default_rng(seed), gtsam.NonlinearFactorGraph()
    offset = np.cumsum(rng.normal(0.0, WALK_M, (frames // EVERY + 1, 3)), axis=0)
    offset[4:] += [0.5, 0.0, -0.3]
    for i in range(0, frames, 2):
        fix = poses[i, :3, 3] + offset[i // EVERY] + rng.normal(0.0, 0.05, 3)
        graph.push_back(offset_fix(i, fix))
    return graph


def drive_with_states(held: bool = False, robust: bool = True) -> BundleProblem:
    """Return a drive of 40 frames with 8 offsets (3,), two biases (6,) (1,), and a shared vector (2,).

    Args:
        held: Whether some poses are held.
        robust: Whether the offsets walk with Cauchy's loss.
    """
    problem, poses = drive()
    if held:
        problem = held_frames()
    graph = gtsam.NonlinearFactorGraph(problem.pose_graph)
    graph.push_back(offset_fixes(40, poses))
    graph.push_back(walk(8, robust))
    for i in (20, 22, 24):
        graph.push_back(turned_by(i, B(0), gtsam.Pose3.Logmap(gtsam.Pose3(poses[i])) + 0.1))
    unit = gtsam.noiseModel.Unit.Create
    graph.push_back(gtsam.PriorFactorVector(B(0), np.full(6, 0.05), unit(6)))
    graph.push_back(gtsam.PriorFactorVector(B(1), np.array([3.0]), unit(1)))
    graph.push_back(gtsam.PriorFactorVector(A(0), np.array([1.0, 2.0]), unit(2)))
    states = {O(k): StateVector(np.zeros(3), EVERY * k) for k in range(8)}
    states |= {B(0): StateVector(np.zeros(6), 20), B(1): StateVector(np.zeros(1), 39)}
    return replace(problem, pose_graph=graph, states=states, shared={A(0): np.zeros(2)})

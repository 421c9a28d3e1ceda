"""A GTSAM factor graph read as a bundle problem: projections as arrays, every other factor as it is."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from vgps.model import FloatArray, IntArray
from vgps.solver.cost import cost_terms
from vgps.solver.gtsam_graphs.graph_vectors import split_vectors
from vgps.solver.gtsam_graphs.noise_models import PixelNoise
from vgps.solver.gtsam_graphs.projection_factors import (
    ProjectionFactors,
    readable_projections,
    split_projections,
)
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem

_MAX_SHARED_SIZE = 300  # coordinates of shared vectors, which are a dense border of the reduced matrix
_MAX_KEY = np.iinfo(np.int64).max
_COST_TOLERANCE = 1e-9  # relative, between the error of the graph and the cost of the problem read from it


class NotABundleError(Exception):
    """The engine cannot solve the graph; the message says why."""


@dataclass(frozen=True)
class GraphBundle:
    """A bundle problem and the graph's values from which it was read.

    Attributes:
        problem: Its frames are the graph's poses.
        landmark_keys: (L,) keys of its landmarks.
        values: The graph's values.
    """

    problem: BundleProblem
    landmark_keys: IntArray
    values: gtsam.Values

    def values_of(self, problem: BundleProblem) -> gtsam.Values:
        """Return the graph's values, moved to the state of ``problem``."""
        delta = gtsam.VectorValues()
        steps = problem.world_p_landmark - self.problem.world_p_landmark
        for key, step in zip(self.landmark_keys.tolist(), steps, strict=True):
            delta.insert(key, step)
        for key, vector in problem.shared.items():
            delta.insert(key, vector - self.problem.shared[key])
        for key, state in problem.states.items():
            delta.insert(key, state.vector - self.problem.states[key].vector)
        values = self.values.retract(delta)
        free = ~problem.fixed_frames
        for key, pose in zip(problem.keys[free].tolist(), problem.world_T_camera[free], strict=True):
            values.update(key, gtsam.Pose3(pose))
        return values


def read_graph(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> GraphBundle:
    """Read ``GenericProjectionFactorCal3_S2`` into arrays, and keep all other factors on poses and vectors.

    A landmark that has any other factor, or a projection that cannot be read (another calibration or loss
    than most), becomes a shared vector of the problem and keeps its factors. Other vectors become states
    where their factors tie them to a few neighbouring poses, else shared vectors.

    Args:
        graph: Every key has a value.
        values: The start.

    Raises:
        NotABundleError: The graph is no bundle problem: few projections, variables that are neither poses
            nor vectors nor biases of an IMU, keys beyond 63 bits, hard constraints other than held poses, or
            factors that are not sums of squares.
    """
    if any(key > _MAX_KEY for key in graph.keyVector()):
        raise NotABundleError(f"keys beyond {_MAX_KEY}")
    projections, others = split_projections(graph)
    if len(projections) <= len(others):
        factors = len(projections) + len(others)
        raise NotABundleError(f"{len(projections)} projections among {factors} factors")
    readable = readable_projections(graph, projections, others)
    if not np.any(readable):
        raise NotABundleError("no projection that can be read")
    others = sorted([*others, *projections.factor[~readable].tolist()])
    pose_graph, held = _split_constraints(graph, others, values)
    bundle = _bundle(projections.select(readable), pose_graph, held, values)
    _verify(bundle.problem, graph, values)
    return bundle


def _split_constraints(
    graph: gtsam.NonlinearFactorGraph, indices: Iterable[int], values: gtsam.Values
) -> tuple[gtsam.NonlinearFactorGraph, set[int]]:
    """Return the factors at these indices, and instead of hard constraints the poses that they hold."""
    pose_graph, held = gtsam.NonlinearFactorGraph(), set()
    for index in indices:
        factor = graph.at(index)
        if not isinstance(factor, gtsam.NoiseModelFactor) or not factor.noiseModel().isConstrained():
            pose_graph.push_back(factor)
            continue
        rigid = isinstance(factor, gtsam.NonlinearEqualityPose3 | gtsam.PriorFactorPose3)
        sigmas = factor.noiseModel().sigmas()
        if not rigid or np.any(sigmas) or np.abs(factor.unwhitenedError(values)).max() > 1e-9:
            raise NotABundleError("a hard constraint other than one that holds a pose at its value")
        held.add(int(factor.keys()[0]))
    return pose_graph, held


def _bundle(
    projections: ProjectionFactors,
    pose_graph: gtsam.NonlinearFactorGraph,
    held: set[int],
    values: gtsam.Values,
) -> GraphBundle:
    observing = set(np.unique(projections.pose_key).tolist())
    other_keys = {int(key) for key in pose_graph.keyVector()} - observing
    poses = observing | held | {key for key in other_keys if is_pose(values, key)}
    sorted_keys = np.array(sorted(poses), dtype=np.int64)
    landmark_keys, landmark = np.unique(projections.point_key, return_inverse=True)
    frame = np.searchsorted(sorted_keys, projections.pose_key)
    pose_keys, frame = _narrow_order(sorted_keys, frame, landmark)
    # unreadable projections were deselected, so the placeholder is never used
    noises = [noise or PixelNoise(1.0, "none", np.inf) for noise in projections.noise_models]
    losses = {noises[i].loss for i in np.unique(projections.noise).tolist()} - {"none"}
    # a vector of more than half of the frames is one of all frames
    close = min(2 * int(_spans(frame, landmark).max()) + 2, len(pose_keys) // 2)
    frame_of = dict(zip(pose_keys.tolist(), range(len(pose_keys)), strict=True))
    vectors, biases = _vectors(values, other_keys - poses)
    shared, states = split_vectors(pose_graph, vectors, frame_of, close)
    _check_shared(shared, biases)
    states |= {key: replace(states[key], is_bias=True) for key in biases}
    fx, fy, _, cx, cy = projections.calibrations[int(projections.camera[0])]
    problem = BundleProblem(
        K=(fx, fy, cx, cy),
        world_T_camera=np.stack([values.atPose3(key).matrix() for key in pose_keys.tolist()]),
        world_p_landmark=np.stack([values.atPoint3(key) for key in landmark_keys.tolist()]),
        frame=frame,
        landmark=landmark,
        uv_px=projections.uv_px,
        sigma_px=np.array([noise.sigma_px for noise in noises])[projections.noise],
        robust=losses.pop() if losses else "none",
        robust_k=np.array([noise.k for noise in noises])[projections.noise],
        pose_graph=pose_graph,
        fixed=np.isin(pose_keys, np.array(sorted(held), dtype=np.int64)),
        shared=shared,
        states=states,
        pose_keys=pose_keys,
    )
    return GraphBundle(problem, landmark_keys, values)


def _narrow_order(pose_keys: IntArray, frame: IntArray, landmark: IntArray) -> tuple[IntArray, IntArray]:
    """Return pose keys and frames in an order that gives the reduced matrix a narrow band.

    Reverse Cuthill-McKee replaces the order of the keys if it at least halves the spans of the tracks.
    """
    shape = int(landmark.max()) + 1, len(pose_keys)
    observed = sparse.csr_array((np.ones(len(frame)), (landmark, frame)), shape=shape)
    order = reverse_cuthill_mckee(sparse.csr_matrix(observed.T @ observed), symmetric_mode=True)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    if 2 * _total_span(rank[frame], landmark) > _total_span(frame, landmark):
        return pose_keys, frame
    return pose_keys[order], rank[frame]


def _total_span(frame: IntArray, landmark: IntArray) -> int:
    return int(np.sum(_spans(frame, landmark)))


def _spans(frame: IntArray, landmark: IntArray) -> IntArray:
    """Return for each landmark the number of frames from the first observation to the last."""
    landmarks = int(landmark.max()) + 1
    first, last = np.full(landmarks, np.iinfo(np.int64).max), np.zeros(landmarks, int)
    np.minimum.at(first, landmark, frame)
    np.maximum.at(last, landmark, frame)
    return np.asarray(last - first)


def is_pose(values: gtsam.Values, key: int) -> bool:
    """Return whether a variable is a ``Pose3``."""
    try:
        values.atPose3(key)
    except RuntimeError:
        return False
    return True


def _vectors(values: gtsam.Values, keys: set[int]) -> tuple[dict[int, FloatArray], set[int]]:
    """Return the values of vectors and IMU biases by key, and the keys of the biases."""
    vectors, biases = {}, set()
    for key in sorted(keys):
        try:
            vectors[key] = np.asarray(values.atVector(key))
        except RuntimeError:
            vectors[key] = _bias(values, key)
            biases.add(key)
    return vectors, biases


def _bias(values: gtsam.Values, key: int) -> FloatArray:
    try:
        return np.asarray(values.atConstantBias(key).vector())
    except RuntimeError:
        name = gtsam.DefaultKeyFormatter(key)
        raise NotABundleError(f"the variable {name} is neither pose, vector nor bias") from None


def _check_shared(shared: Mapping[int, FloatArray], biases: set[int]) -> None:
    distant = sorted(biases & shared.keys())
    if distant:
        raise NotABundleError(f"the bias {gtsam.DefaultKeyFormatter(distant[0])} of poses far apart")
    size = sum(len(vector) for vector in shared.values())
    if size > _MAX_SHARED_SIZE:
        raise NotABundleError(
            f"{size} coordinates of points and vectors that all poses share, at most {_MAX_SHARED_SIZE}"
        )


def _verify(problem: BundleProblem, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """Compare the cost with the graph's error, which reveals a body_P_sensor that GTSAM does not expose."""
    error, cost = graph.error(values), sum(cost_terms(problem).values())
    if not np.isclose(cost, error, rtol=_COST_TOLERANCE, atol=1e-12):
        raise NotABundleError(f"its error is {error:.9g}, that of the factors as read {cost:.9g}")
    try:
        problem.pose_graph.linearize(all_pose_values(problem)).sparseJacobian_()
    except (RuntimeError, ValueError):
        raise NotABundleError("a factor that does not linearise to a sum of squares") from None

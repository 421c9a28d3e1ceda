"""A GTSAM factor graph read as a bundle problem: the projections as arrays, every other factor as it is."""

from collections.abc import Iterable
from dataclasses import dataclass

import gtsam
import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from vgps.model import FloatArray, IntArray
from vgps.solver.noise_models import Noise
from vgps.solver.problem import BundleProblem, all_pose_values, cost_terms
from vgps.solver.projection_factors import Calibration, ProjectionFactors, sorted_out, usual, with_more

_MOST_SHARED = 300  # coordinates solved for beside the poses; they are a dense border of the matrix
_MOST_KEY = np.iinfo(np.int64).max
_SAME_COST = 1e-9  # relative: what was read costs what the graph does


class NotABundleError(Exception):
    """The graph is none that the engine solves; the message says why."""


@dataclass(frozen=True)
class GraphBundle:
    """A bundle problem and where it came from.

    Attributes:
        problem: Its frames are the graph's poses.
        landmark_keys: (L,).
        values: The graph's.
    """

    problem: BundleProblem
    landmark_keys: IntArray
    values: gtsam.Values

    def values_of(self, problem: BundleProblem) -> gtsam.Values:
        """The values moved to where ``problem`` is now."""
        delta = gtsam.VectorValues()
        steps = problem.world_p_landmark - self.problem.world_p_landmark
        for key, step in zip(self.landmark_keys.tolist(), steps, strict=True):
            delta.insert(key, step)
        for key, vector in problem.shared.items():
            delta.insert(key, vector - self.problem.shared[key])
        values = self.values.retract(delta)
        moves = ~problem.fixed_frames
        for key, pose in zip(problem.keys[moves].tolist(), problem.world_T_camera[moves], strict=True):
            values.update(key, gtsam.Pose3(pose))
        return values


def read_graph(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> GraphBundle:
    """Read ``GenericProjectionFactorCal3_S2`` into arrays; keep all else as factors on poses and vectors.

    A landmark that has any other factor, or a projection that cannot be read (another calibration, another
    loss than most), becomes one of the problem's shared vectors, with all its factors as they are.

    Args:
        graph: With a value for every key.
        values: Where it is to be solved from.

    Raises:
        NotABundleError: It is no bundle problem: few projections, variables that are neither poses nor
            vectors, keys beyond 63 bits, hard constraints other than held poses, factors that are not least
            squares.
    """
    if any(key > _MOST_KEY for key in graph.keyVector()):
        raise NotABundleError(f"keys beyond {_MOST_KEY}")
    observations, noises, cameras, others = sorted_out(graph)
    if len(observations.place) <= len(others):
        raise NotABundleError(
            f"{len(observations.place)} projections among {len(observations.place) + len(others)} factors"
        )
    read = usual(observations, noises, cameras)
    read &= ~with_more(graph, observations, read, others)
    if not np.any(read):
        raise NotABundleError("no projection that can be read")
    others = sorted([*others, *observations.place[~read].tolist()])
    pose_graph, held = _pose_graph(graph, others, values)
    bundle = _bundle(observations.only(read), noises, cameras, pose_graph, held, values)
    _check(bundle.problem, graph, values)
    return bundle


def _pose_graph(
    graph: gtsam.NonlinearFactorGraph, places: Iterable[int], values: gtsam.Values
) -> tuple[gtsam.NonlinearFactorGraph, set[int]]:
    """The other factors, and the poses that a hard constraint holds where they are."""
    pose_graph, held = gtsam.NonlinearFactorGraph(), set()
    for place in places:
        factor = graph.at(place)
        if not isinstance(factor, gtsam.NoiseModelFactor) or not factor.noiseModel().isConstrained():
            pose_graph.push_back(factor)
            continue
        model = factor.noiseModel()
        rigid = isinstance(factor, gtsam.NonlinearEqualityPose3 | gtsam.PriorFactorPose3)
        if not rigid or np.any(model.sigmas()) or np.abs(factor.unwhitenedError(values)).max() > 1e-9:
            raise NotABundleError("a hard constraint that does not just hold a pose where it is")
        held.add(int(factor.keys()[0]))
    return pose_graph, held


def _bundle(
    observations: ProjectionFactors,
    noises: list[Noise | None],
    cameras: list[Calibration],
    pose_graph: gtsam.NonlinearFactorGraph,
    held: set[int],
    values: gtsam.Values,
) -> GraphBundle:
    seen_from = set(np.unique(observations.pose).tolist())
    more = {int(key) for key in pose_graph.keyVector()} - seen_from
    poses = seen_from | held | {key for key in more if is_pose(values, key)}
    in_order = np.array(sorted(poses), dtype=np.int64)
    landmark_keys, landmark = np.unique(observations.point, return_inverse=True)
    frame = np.searchsorted(in_order, observations.pose)
    pose_keys, frame = _near_each_other(in_order, frame, landmark)
    known = [noise or Noise(1.0, "none", np.inf) for noise in noises]  # of those read none is unknown
    losses = {known[i].loss for i in np.unique(observations.noise).tolist()} - {"none"}
    fx, fy, _, cx, cy = cameras[int(observations.camera[0])]
    problem = BundleProblem(
        K=(fx, fy, cx, cy),
        world_T_camera=np.stack([values.atPose3(key).matrix() for key in pose_keys.tolist()]),
        world_p_landmark=np.stack([values.atPoint3(key) for key in landmark_keys.tolist()]),
        frame=frame,
        landmark=landmark,
        uv_px=observations.uv_px,
        sigma_px=np.array([noise.sigma_px for noise in known])[observations.noise],
        robust=losses.pop() if losses else "none",
        robust_k=np.array([noise.k for noise in known])[observations.noise],
        pose_graph=pose_graph,
        fixed=np.isin(pose_keys, np.array(sorted(held), dtype=np.int64)),
        shared=_vectors(values, more - poses),
        pose_keys=pose_keys,
    )
    return GraphBundle(problem, landmark_keys, values)


def _near_each_other(pose_keys: IntArray, frame: IntArray, landmark: IntArray) -> tuple[IntArray, IntArray]:
    """Keys and frames in an order that has the observations of a landmark near each other.

    That of the keys, unless reverse Cuthill and McKee's halves the frames between first and last observation.
    """
    shape = int(landmark.max()) + 1, len(pose_keys)
    seen = sparse.csr_array((np.ones(len(frame)), (landmark, frame)), shape=shape)
    order = reverse_cuthill_mckee(sparse.csr_matrix(seen.T @ seen), symmetric_mode=True)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    if 2 * _spans(place[frame], landmark) > _spans(frame, landmark):
        return pose_keys, frame
    return pose_keys[order], place[frame]


def _spans(frame: IntArray, landmark: IntArray) -> int:
    first, last = (
        np.full(int(landmark.max()) + 1, np.iinfo(np.int64).max),
        np.zeros(int(landmark.max()) + 1, int),
    )
    np.minimum.at(first, landmark, frame)
    np.maximum.at(last, landmark, frame)
    return int(np.sum(last - first))


def is_pose(values: gtsam.Values, key: int) -> bool:
    """Whether a variable is a ``Pose3``."""
    try:
        values.atPose3(key)
    except RuntimeError:
        return False
    return True


def _vectors(values: gtsam.Values, keys: set[int]) -> dict[int, FloatArray]:
    vectors = {}
    for key in sorted(keys):
        try:
            vectors[key] = np.asarray(values.atVector(key))
        except RuntimeError:
            name = gtsam.DefaultKeyFormatter(key)
            raise NotABundleError(f"the variable {name} is neither a pose nor a vector") from None
    size = sum(len(vector) for vector in vectors.values())
    if size > _MOST_SHARED:
        raise NotABundleError(
            f"{size} coordinates beside poses and landmarks seen by projections alone, at most {_MOST_SHARED}"
        )
    return vectors


def _check(problem: BundleProblem, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
    """What cannot be read of a factor, such as where its camera sits on its body, shows in the cost."""
    cost, read = graph.error(values), sum(cost_terms(problem).values())
    if not np.isclose(read, cost, rtol=_SAME_COST, atol=1e-12):
        raise NotABundleError(f"its error is {cost:.9g}, that of what could be read of it {read:.9g}")
    try:
        problem.pose_graph.linearize(all_pose_values(problem)).sparseJacobian_()
    except (RuntimeError, ValueError):
        raise NotABundleError("a factor that is not a sum of squares once it is linear") from None

"""A GTSAM factor graph read as a bundle problem: the projections as arrays, every other factor as it is."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import gtsam
import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.smoothing.bundle import BundleProblem, all_pose_values, cost_terms
from vgps.smoothing.noise_reading import Noise, read_noise

_MOST_SHARED = 300  # coordinates solved for beside the poses; they are a dense border of the matrix
_SAME_COST = 1e-9  # relative: what was read costs what the graph does


class NotABundleError(Exception):
    """The graph is none that the engine solves; the message says why."""


class _Projection(NamedTuple):
    """A projection factor by its place in the graph, with what is easily read of it."""

    place: int
    pose: int
    point: int
    noise: Noise | None
    K: tuple[float, float, float, float, float]
    uv_px: FloatArray


@dataclass(frozen=True)
class GraphBundle:
    """A bundle problem and where it came from.

    Attributes:
        problem: Its frames are the graph's poses in ascending order of their keys.
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
            vectors, hard constraints other than held poses, factors that are not least squares.
    """
    projections, others = _sorted_out(graph)
    if len(projections) <= len(others):
        raise NotABundleError(
            f"{len(projections)} projections among {len(projections) + len(others)} factors"
        )
    usual = _usual(projections)
    with_more = _points_with_more(graph, projections, usual, others)
    arrays = [p for p in usual if p.point not in with_more]
    if not arrays:
        raise NotABundleError("no projection that can be read")
    read = {p.place for p in arrays}
    others = sorted([*others, *(p.place for p in projections if p.place not in read)])
    pose_graph, held = _pose_graph(graph, others, values)
    bundle = _bundle(arrays, pose_graph, held, values)
    _check(bundle.problem, graph, values)
    return bundle


def _sorted_out(graph: gtsam.NonlinearFactorGraph) -> tuple[list[_Projection], list[int]]:
    projections, others = [], []
    # GTSAM hands out one object for one model as long as it lives: each is read once
    noises: dict[int, tuple[object, Noise | None]] = {}
    cameras: dict[int, tuple[object, tuple[float, float, float, float, float]]] = {}
    for place in range(graph.size()):
        factor = graph.at(place)
        if factor is None:
            continue
        if type(factor) is not gtsam.GenericProjectionFactorCal3_S2 or factor.throwCheirality():
            others.append(place)
            continue
        model, K = factor.noiseModel(), factor.calibration()
        if id(model) not in noises:
            noises[id(model)] = model, read_noise(model)
        if id(K) not in cameras:
            cameras[id(K)] = K, (K.fx(), K.fy(), K.skew(), K.px(), K.py())
        pose, point = factor.keys()
        read = noises[id(model)][1], cameras[id(K)][1], factor.measured()
        projections.append(_Projection(place, pose, point, *read))
    return projections, others


def _usual(projections: list[_Projection]) -> list[_Projection]:
    """Those of one calibration without skew, and of no loss or the most frequent one."""
    known = [(p, p.noise) for p in projections if p.noise is not None and p.K[2] == 0.0]
    cameras = Counter(p.K for p, _ in known)
    losses = Counter(noise.loss for _, noise in known if noise.loss != "none")
    K = cameras.most_common(1)[0][0] if cameras else None
    fitting = {"none", *(loss for loss, _ in losses.most_common(1))}
    return [p for p, noise in known if p.K == K and noise.loss in fitting]


def _points_with_more(
    graph: gtsam.NonlinearFactorGraph,
    projections: list[_Projection],
    usual: list[_Projection],
    others: list[int],
) -> set[int]:
    """Keys of landmarks that have other factors than readable projections, or two in one pose."""
    read = {p.place for p in usual}
    unread = [p.place for p in projections if p.place not in read]
    twice = [pair for pair, times in Counter((p.pose, p.point) for p in usual).items() if times > 1]
    touched = {key for place in (*others, *unread) for key in list(graph.at(place).keys())}
    return {p.point for p in usual if p.point in touched} | {point for _, point in twice}


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
    arrays: list[_Projection], pose_graph: gtsam.NonlinearFactorGraph, held: set[int], values: gtsam.Values
) -> GraphBundle:
    seen_from = {p.pose for p in arrays}
    more = {int(key) for key in pose_graph.keyVector()} - seen_from
    poses = seen_from | held | {key for key in more if is_pose(values, key)}
    pose_keys = np.array(sorted(poses), dtype=np.int64)
    landmark_keys, landmark = np.unique([p.point for p in arrays], return_inverse=True)
    noises = [p.noise for p in arrays if p.noise is not None]
    losses = {noise.loss for noise in noises} - {"none"}
    fx, fy, _, cx, cy = arrays[0].K
    problem = BundleProblem(
        K=(fx, fy, cx, cy),
        world_T_camera=np.stack([values.atPose3(key).matrix() for key in pose_keys.tolist()]),
        world_p_landmark=np.stack([values.atPoint3(key) for key in landmark_keys.tolist()]),
        frame=np.searchsorted(pose_keys, np.array([p.pose for p in arrays])),
        landmark=landmark,
        uv_px=np.stack([p.uv_px for p in arrays]),
        sigma_px=np.array([noise.sigma_px for noise in noises]),
        robust=losses.pop() if losses else "none",
        robust_k=np.array([noise.k for noise in noises]),
        pose_graph=pose_graph,
        fixed=np.isin(pose_keys, np.array(sorted(held), dtype=np.int64)),
        shared=_vectors(values, more - poses),
        pose_keys=pose_keys,
    )
    return GraphBundle(problem, landmark_keys, values)


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

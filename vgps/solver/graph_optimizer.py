"""The fast engine behind GTSAM's interface: a factor graph and values in, values out."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.errors import GeometryError
from vgps.model import FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.solver.elimination import Structure, structure_of
from vgps.solver.graph_reading import NotABundleError, is_pose, read_graph
from vgps.solver.gtsam_backend import optimise_with_gtsam
from vgps.solver.levenberg_marquardt import SolverSettings, levenberg
from vgps.solver.schur_complement import Solver, covariances

__all__ = ["GraphResult", "SolverSettings", "optimise_graph", "pose_marginals"]


@dataclass(frozen=True)
class GraphResult:
    """Where the optimiser ended.

    Attributes:
        values: Never of a higher error than the start's.
        error_before, error_after: ``graph.error`` there.
        iterations: Linearisations.
        reason: Why it stopped.
        converged: Whether a tolerance was reached.
        solver: ``schur``, this package's engine, or ``gtsam``.
        why_gtsam: What the engine does not do; empty where it did.
        seconds: Wall time, reading the graph included.
    """

    values: gtsam.Values
    error_before: float
    error_after: float
    iterations: int
    reason: str
    converged: bool
    solver: Solver
    why_gtsam: str
    seconds: float


def optimise_graph(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, settings: SolverSettings | None = None
) -> GraphResult:
    """Levenberg-Marquardt with the landmarks eliminated, to the minimum that GTSAM's own finds.

    Projections, ``GenericProjectionFactorCal3_S2`` of one calibration, are taken out of the graph once, as
    arrays; a point behind a camera has GTSAM's constant residual and no Jacobian. Noise: isotropic, alone or
    within Huber's or Cauchy's loss. GTSAM linearises every other factor: priors, motion, fixes, factors in
    Python. A graph that is no such bundle, or whose poses hang together too much, goes to GTSAM's optimiser,
    with the landmarks first; ``why_gtsam`` says why.

    Args:
        graph: Poses are ``Pose3``, world_T_camera; any keys.
        values: Start, for every variable of the graph; what the graph does not have stays as it is.
        settings: When to stop, how to damp, and how much the engine may take on.

    Raises:
        ValueError: A variable of the graph has no value.
        GeometryError: The error at the start is not finite.
    """
    settings, begun = settings or SolverSettings(), time.perf_counter()
    before = _error(graph, values)
    try:
        bundle = read_graph(graph, values)
        structure = structure_of(bundle.problem)
        if not structure.fits(settings.max_flops, settings.max_bytes):
            raise NotABundleError(_too_dense(structure, settings))
    except NotABundleError as no:
        found = optimise_with_gtsam(graph, values, _landmarks_first(graph), settings)
        moved, why = found.values, str(no)
        told = found.iterations, found.reason, found.converged
    else:
        with one_blas_thread():
            outcome = levenberg(bundle.problem, structure, settings)
        moved, why = bundle.values_of(outcome.problem), ""
        told = outcome.iterations, outcome.reason, outcome.converged
    after, seconds = graph.error(moved), time.perf_counter() - begun
    return GraphResult(moved, before, after, *told, "gtsam" if why else "schur", why, seconds)


def _too_dense(structure: Structure, settings: SolverSettings) -> str:
    return (
        f"the poses hang together too much: {structure.flops:.1e} operations and {structure.bytes:.1e} bytes "
        f"an iteration, at most {settings.max_flops:.1e} and {settings.max_bytes:.1e}"
    )


def pose_marginals(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> Mapping[int, FloatArray]:
    """Marginal covariances (6, 6) of the poses at a minimum, by key; as ``gtsam.Marginals`` has them.

    Tangent [rotation; translation] in the camera's own axes, rad and m; zero where a constraint holds a pose.

    Raises:
        ValueError: A variable of the graph has no value.
        GeometryError: The graph does not determine the poses.
    """
    _error(graph, values)
    try:
        bundle = read_graph(graph, values)
    except NotABundleError:
        return _marginals_of_gtsam(graph, values)
    limits = SolverSettings()
    if not structure_of(bundle.problem).fits(limits.max_flops, limits.max_bytes):
        return _marginals_of_gtsam(graph, values)
    blocks = covariances(bundle.problem).poses
    return dict(zip(bundle.problem.keys.tolist(), blocks, strict=True))


def _error(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> float:
    missing = [key for key in graph.keyVector() if not values.exists(key)]
    if missing:
        raise ValueError(f"no value for {gtsam.DefaultKeyFormatter(missing[0])}, which the graph has")
    error = float(graph.error(values))
    if not np.isfinite(error):
        raise GeometryError(
            f"the error at the start is {error}", remedy="start from better poses", expected="a finite one"
        )
    return error


def _landmarks_first(graph: gtsam.NonlinearFactorGraph) -> list[int]:
    """Keys of the points that are seen and that no factor ties to another, then all others as COLAMD orders.

    Other vectors, lever arms and biases, hang on many poses: first, they would tie these to each other.
    """
    factors = [factor for factor in map(graph.at, range(graph.size())) if factor is not None]
    keys = [set(factor.keys()) for factor in factors]
    observations = (one for one in factors if isinstance(one, gtsam.GenericProjectionFactorCal3_S2))
    points = {one.keys()[1] for one in observations}
    for own in keys:
        tied = points & own
        if len(tied) > 1:
            points -= tied
    first = sorted(points)
    ordering = gtsam.Ordering.ColamdConstrainedFirstNonlinearFactorGraph(graph, first, False)
    return [ordering.at(i) for i in range(ordering.size())]


def _marginals_of_gtsam(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> Mapping[int, FloatArray]:
    try:
        marginals = gtsam.Marginals(graph, values)
    except RuntimeError as error:
        raise GeometryError(
            "the graph does not determine its variables", remedy="add priors, fixes or motion factors"
        ) from error
    poses = (key for key in graph.keyVector() if is_pose(values, key))
    return {key: np.asarray(marginals.marginalCovariance(key)) for key in poses}

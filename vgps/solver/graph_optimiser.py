"""The sparse engine behind GTSAM's interface: a factor graph and values in, values out."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.errors import GeometryError
from vgps.model import FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.solver.bundle_adjustment import Solver
from vgps.solver.equations.elimination import SparsityStructure, analyse_sparsity
from vgps.solver.gtsam_backend import optimise_with_gtsam
from vgps.solver.gtsam_graphs.graph_reading import NotABundleError, is_pose, read_graph
from vgps.solver.iterate import iterate_at
from vgps.solver.levenberg_marquardt import SolverSettings, minimise
from vgps.solver.marginals import marginal_covariances

__all__ = ["GraphResult", "SolverSettings", "optimise_graph", "pose_marginals"]


@dataclass(frozen=True, kw_only=True)
class GraphResult:
    """Result of an optimisation.

    Attributes:
        values: Their error is never above that of the start.
        error_before, error_after: ``graph.error`` at the start and at ``values``.
        iterations: Number of linearisations.
        reason: Why the optimiser stopped.
        converged: Whether a tolerance was reached.
        solver: ``schur`` for this package's engine, or ``gtsam``.
        fallback_reason: Why the engine could not be used; empty if it was.
        seconds: Wall time, including the reading of the graph.
    """

    values: gtsam.Values
    error_before: float
    error_after: float
    iterations: int
    reason: str
    converged: bool
    solver: Solver
    fallback_reason: str
    seconds: float


def optimise_graph(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, settings: SolverSettings | None = None
) -> GraphResult:
    """Minimise the error of a factor graph by Levenberg-Marquardt with the landmarks eliminated.

    Projections, ``GenericProjectionFactorCal3_S2`` of one calibration, are read once into arrays; a landmark
    behind a camera has GTSAM's constant residual and no Jacobian. Their noise is isotropic, without a loss or
    with Huber's or Cauchy's. GTSAM linearises every other factor: priors, motion, fixes, factors in Python.
    A graph that is no such bundle problem, or whose poses are coupled too densely, goes to GTSAM's optimiser
    with landmarks first in the ordering; ``fallback_reason`` gives the reason.

    Args:
        graph: Poses are ``Pose3``, world_T_camera; any keys.
        values: Start, for every variable of the graph; other variables keep their values.
        settings: Stopping criteria, damping and limits of the engine.

    Raises:
        ValueError: A variable of the graph has no value.
        GeometryError: The error at the start is not finite.
    """
    settings, begin = settings or SolverSettings(), time.perf_counter()
    before = _finite_error(graph, values)
    try:
        bundle = read_graph(graph, values)
        structure = analyse_sparsity(bundle.problem)
        if not structure.fits(settings.max_flops, settings.max_bytes):
            raise NotABundleError(_too_dense(structure, settings))
    except NotABundleError as error:
        fallback_reason = str(error)
        result, end = optimise_with_gtsam(graph, values, _landmarks_first(graph), settings)
    else:
        fallback_reason = ""
        with one_blas_thread():
            best, end = minimise(iterate_at(bundle.problem, structure), structure, settings)
        result = bundle.values_of(best.problem)
    return GraphResult(
        values=result,
        error_before=before,
        error_after=graph.error(result),
        iterations=end.iterations,
        reason=end.reason,
        converged=end.converged,
        solver="gtsam" if fallback_reason else "schur",
        fallback_reason=fallback_reason,
        seconds=time.perf_counter() - begin,
    )


def _too_dense(structure: SparsityStructure, settings: SolverSettings) -> str:
    return (
        f"the poses are coupled too densely: {structure.flops:.1e} operations and {structure.bytes:.1e} "
        f"bytes per iteration, at most {settings.max_flops:.1e} and {settings.max_bytes:.1e}"
    )


def pose_marginals(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> Mapping[int, FloatArray]:
    """Return the marginal covariances (6, 6) of the poses at a minimum by key, as ``gtsam.Marginals`` does.

    Tangent [rotation; translation] in the camera's own axes, rad and m; zero where a constraint holds a pose.

    Raises:
        ValueError: A variable of the graph has no value.
        GeometryError: The graph does not determine the poses.
    """
    _finite_error(graph, values)
    limits = SolverSettings()
    try:
        problem = read_graph(graph, values).problem
    except NotABundleError:
        return _marginals_of_gtsam(graph, values)
    if not analyse_sparsity(problem).fits(limits.max_flops, limits.max_bytes):
        return _marginals_of_gtsam(graph, values)
    return dict(zip(problem.keys.tolist(), marginal_covariances(problem).poses, strict=True))


def _finite_error(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> float:
    missing = [key for key in graph.keyVector() if not values.exists(key)]
    if missing:
        raise ValueError(f"no value for {gtsam.DefaultKeyFormatter(missing[0])}, a variable of the graph")
    error = float(graph.error(values))
    if not np.isfinite(error):
        raise GeometryError(
            f"the error at the start is {error}",
            expected="a finite error",
            remedy="start from better poses",
        )
    return error


def _landmarks_first(graph: gtsam.NonlinearFactorGraph) -> list[int]:
    """Return keys in order of elimination: landmarks not tied to each other, then all others by COLAMD.

    Other vectors, such as lever arms and biases, occur in factors of many poses. Eliminated first they would
    couple all of these poses.
    """
    factors = [factor for factor in map(graph.at, range(graph.size())) if factor is not None]
    projections = (one for one in factors if isinstance(one, gtsam.GenericProjectionFactorCal3_S2))
    points = {one.keys()[1] for one in projections}
    for factor in factors:
        tied = points & set(factor.keys())
        if len(tied) > 1:
            points -= tied
    ordering = gtsam.Ordering.ColamdConstrainedFirstNonlinearFactorGraph(graph, sorted(points), False)
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

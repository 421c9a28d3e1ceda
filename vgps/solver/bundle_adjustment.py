"""Bundle adjustment: Levenberg-Marquardt on a bundle problem, by the sparse engine or by GTSAM.

The engine finds the minimum that GTSAM's own optimiser finds, several times faster. Where the poses are
coupled too densely for it, GTSAM's optimiser is used.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vgps.errors import GeometryError
from vgps.runtime.memory import peak_memory_mb
from vgps.runtime.threads import one_blas_thread
from vgps.solution import SolverReport, SubmapReport
from vgps.solver.cost import cost_terms
from vgps.solver.equations.elimination import SparsityStructure, analyse_sparsity
from vgps.solver.gtsam_backend import solve_with_gtsam
from vgps.solver.iterate import iterate_at
from vgps.solver.levenberg_marquardt import SolverSettings, minimise
from vgps.solver.problem import BundleProblem

__all__ = ["BundleResult", "Solver", "SolverSettings", "solve"]

Solver = Literal["schur", "gtsam"]


@dataclass(frozen=True, kw_only=True)
class BundleResult:
    """Result of a bundle adjustment.

    Attributes:
        problem: The problem with its new poses and landmarks; its cost is never above that of the start.
        report: Cost per term before and after, iterations, and why the optimiser stopped.
        solver: The optimiser that was used.
        converged: Whether a tolerance was reached.
        stuck: Whether no step lowered the cost although the start is no minimum. The result is then the
            start, and must not be taken for an optimum.
        seconds: Wall time.
    """

    problem: BundleProblem
    report: SolverReport
    solver: Solver
    converged: bool
    stuck: bool
    seconds: float


def solve(
    problem: BundleProblem, settings: SolverSettings | None = None, solver: Solver = "schur"
) -> BundleResult:
    """Minimise the cost over the free poses, all landmarks and the shared vectors.

    Args:
        problem: The start.
        settings: Tolerances and limits.
        solver: ``schur`` for the sparse engine, ``gtsam`` for GTSAM's Levenberg-Marquardt.

    Raises:
        GeometryError: The cost at the start is not finite.
        ValueError: A landmark is observed twice in one frame, or a pose factor has an unknown key.
    """
    settings = settings or SolverSettings()
    begin = time.perf_counter()
    structure = analyse_sparsity(problem) if solver == "schur" else None
    if structure is not None and structure.fits(settings.max_flops, settings.max_bytes):
        with one_blas_thread():
            start = iterate_at(problem, structure)
            _check_finite(before := start.cost_terms)
            best, end = minimise(start, structure, settings)
        solved, after = best.problem, best.cost_terms
    else:
        solver, structure = "gtsam", None
        _check_finite(before := cost_terms(problem))
        solved, end = solve_with_gtsam(problem, settings)
        after = cost_terms(solved)
    return BundleResult(
        problem=solved,
        report=SolverReport(before, after, end.iterations, end.reason, _submaps(structure)),
        solver=solver,
        converged=end.converged,
        stuck=end.stuck,
        seconds=time.perf_counter() - begin,
    )


def _check_finite(cost: Mapping[str, float]) -> None:
    """Raise an error unless the cost at the start, by its terms, is finite."""
    if not np.isfinite(sum(cost.values())):
        terms = ", ".join(f"{name} {value:.4g}" for name, value in cost.items())
        raise GeometryError(
            f"the cost at the start is not finite ({terms})",
            expected="poses near enough for every factor",
            remedy="start from better poses, or raise the wall's exponent in stages",
        )


def _submaps(structure: SparsityStructure | None) -> SubmapReport | None:
    """Return what the run says of its submaps."""
    layout = None if structure is None else structure.submaps
    if layout is None:
        return None
    return SubmapReport(
        tuple(np.diff(layout.first).tolist()), tuple(layout.separator.tolist()), peak_memory_mb()
    )

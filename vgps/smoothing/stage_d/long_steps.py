"""Long steps of stage D, taken from the journal of an interrupted run where it has them."""

from collections.abc import Callable
from typing import Any

from vgps.model import FloatArray
from vgps.runtime.journal import Journal
from vgps.solution import SolverReport, SubmapReport
from vgps.solver.bundle_adjustment import BundleResult, Solver, SolverSettings, solve
from vgps.solver.marginals import Covariances
from vgps.solver.problem import BundleProblem


def solve_once(
    problem: BundleProblem, settings: SolverSettings, solver: Solver, journal: Journal | None
) -> BundleResult:
    """Return the solution of a problem as :func:`~vgps.solver.bundle_adjustment.solve` does."""
    if journal is None:
        return solve(problem, settings, solver)

    def compute() -> dict[str, Any]:
        result = solve(problem, settings, solver)
        return {**vars(result), "problem": _variables(result.problem)}

    found = journal.step(_start(problem), compute, (SolverReport, SubmapReport))
    end = found["problem"]
    states = {key: state.moved(end["states"][key]) for key, state in problem.states.items()}
    solved = problem.moved(end["poses"], end["points"], end["shared"], states)
    return BundleResult(**{**found, "problem": solved})


def covariances_once(
    problem: BundleProblem, draw: Callable[[], Covariances], journal: Journal | None
) -> Covariances:
    """Return the covariances of a problem at its optimum."""
    return draw() if journal is None else journal.step(_start(problem), draw, (Covariances,))


def _start(problem: BundleProblem) -> tuple[FloatArray, FloatArray, FloatArray]:
    return problem.world_T_camera, problem.world_p_landmark, problem.sigma_px


def _variables(problem: BundleProblem) -> dict[str, Any]:
    """Return what a solution changes of a problem."""
    return {
        "poses": problem.world_T_camera,
        "points": problem.world_p_landmark,
        "shared": dict(problem.shared),
        "states": {key: state.vector for key, state in problem.states.items()},
    }

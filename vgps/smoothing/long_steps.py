"""Long steps of stage D, taken from the journal of an interrupted run where it has them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from vgps.model import FloatArray
from vgps.runtime.journal import Journal
from vgps.solution import SolverReport, SubmapReport
from vgps.solver.bundle_adjustment import BundleResult, Solver, SolverSettings, solve
from vgps.solver.marginals import Covariances
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True, kw_only=True)
class _Minimum:
    """What a solution changes of a problem, and the other attributes of a :class:`BundleResult`."""

    poses: FloatArray
    points: FloatArray
    shared: Mapping[int, FloatArray]
    states: Mapping[int, FloatArray]
    report: SolverReport
    solver: Solver
    converged: bool
    stuck: bool
    seconds: float


def solve_once(
    problem: BundleProblem, settings: SolverSettings, solver: Solver, journal: Journal | None
) -> BundleResult:
    """Return the solution of a problem as :func:`~vgps.solver.bundle_adjustment.solve` does."""
    if journal is None:
        return solve(problem, settings, solver)

    def minimum() -> _Minimum:
        return _minimum(solve(problem, settings, solver))

    found = journal.step(_start(problem), minimum, (_Minimum, SolverReport, SubmapReport))
    states = {key: state.moved(found.states[key]) for key, state in problem.states.items()}
    solved = replace(
        problem, world_T_camera=found.poses, world_p_landmark=found.points, shared=found.shared, states=states
    )
    return BundleResult(
        problem=solved,
        report=found.report,
        solver=found.solver,
        converged=found.converged,
        stuck=found.stuck,
        seconds=found.seconds,
    )


def covariances_once(
    problem: BundleProblem, draw: Callable[[], Covariances], journal: Journal | None
) -> Covariances:
    """Return the covariances of a problem at its optimum."""
    return draw() if journal is None else journal.step(_start(problem), draw, (Covariances,))


def _start(problem: BundleProblem) -> tuple[FloatArray, FloatArray, FloatArray]:
    return problem.world_T_camera, problem.world_p_landmark, problem.sigma_px


def _minimum(result: BundleResult) -> _Minimum:
    problem = result.problem
    return _Minimum(
        poses=problem.world_T_camera,
        points=problem.world_p_landmark,
        shared=dict(problem.shared),
        states={key: state.vector for key, state in problem.states.items()},
        report=result.report,
        solver=result.solver,
        converged=result.converged,
        stuck=result.stuck,
        seconds=result.seconds,
    )

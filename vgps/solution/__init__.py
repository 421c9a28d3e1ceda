"""The result of a run: poses, landmarks, verdicts on the fixes, and reports of sensors and optimiser.

Conventions of frames, times and names are those of :mod:`vgps.model`.
"""

from vgps.solution.clock import GpsClock
from vgps.solution.fix_table import FixTable, Verdict
from vgps.solution.joined_runs import JoinedRuns
from vgps.solution.landmarks import Landmarks, Observations
from vgps.solution.reports import SensorReport, SolverReport, SubmapReport
from vgps.solution.result import Solution, SolvedCamera
from vgps.solution.trajectory import FrameState, Trajectory

__all__ = [
    "FixTable",
    "FrameState",
    "GpsClock",
    "JoinedRuns",
    "Landmarks",
    "Observations",
    "SensorReport",
    "Solution",
    "SolvedCamera",
    "SolverReport",
    "SubmapReport",
    "Trajectory",
    "Verdict",
]
